#include "services/dispatcher/job_queue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <random>

#include "services/dispatcher/cost_model.h"

namespace flamefield {
namespace {

const std::vector<Candidate> kNobody;
const std::vector<Candidate> kTwo = {{"small", 8 * 1024}, {"large", 16 * 1024}};

std::vector<std::int64_t> taken(JobQueue& queue, const Candidate& worker = {"w", 0}, std::int64_t now = 1) {
  std::vector<std::int64_t> ids;
  while (auto job = queue.take(worker, std::vector{worker}, now)) ids.push_back(job->id);
  return ids;
}

TEST(JobQueue, LiveGoesBeforeInteractiveBeforeScheduled) {
  JobQueue queue;
  queue.add({.id = 1, .priority = Priority::Scheduled});
  queue.add({.id = 2, .priority = Priority::Live});
  queue.add({.id = 3, .priority = Priority::Interactive});
  EXPECT_EQ(taken(queue), (std::vector<std::int64_t>{2, 3, 1}));
}

TEST(JobQueue, LiveJobsGoNewestFirstAndOthersOldestFirst) {
  JobQueue queue;
  for (int i = 1; i <= 3; ++i) queue.add({.id = i, .priority = Priority::Live, .share = "burst"});
  for (int i = 4; i <= 6; ++i) queue.add({.id = i, .priority = Priority::Interactive, .share = "me"});
  EXPECT_EQ(taken(queue), (std::vector<std::int64_t>{3, 2, 1, 4, 5, 6}));
}

TEST(JobQueue, SharesOfEqualPriorityAreServedByCost) {
  JobQueue queue;
  for (int i = 0; i < 300; ++i) {
    queue.add({.id = 1000 + i, .share = "cheap", .cost_s = 1});
    queue.add({.id = 2000 + i, .share = "dear", .cost_s = 3});
  }
  std::map<std::string, double> served;
  for (int i = 0; i < 200; ++i) {
    const auto job = queue.take({"w", 0}, {}, 1);
    served[job->share] += job->cost_s;
    EXPECT_LE(std::abs(served["cheap"] - served["dear"]), 3) << i;
  }
}

TEST(JobQueue, WhoComesLateGetsNoMoreThanAFairShareFromThenOn) {
  JobQueue queue;
  for (int i = 0; i < 200; ++i) queue.add({.id = i, .share = "early"});
  for (int i = 0; i < 100; ++i) (void)queue.take({"w", 0}, {}, 1);
  for (int i = 0; i < 100; ++i) queue.add({.id = 1000 + i, .share = "late"});
  int late = 0;
  for (int i = 0; i < 50; ++i) late += queue.take({"w", 0}, {}, 1)->share == "late";
  EXPECT_NEAR(late, 25, 1);
}

TEST(JobQueue, AWorkerGetsOnlyWhatItsMemoryHolds) {
  JobQueue queue;
  queue.add({.id = 1, .need_mib = 12 * 1024});
  queue.add({.id = 2, .need_mib = 4 * 1024});
  EXPECT_EQ(taken(queue, kTwo[0]), std::vector<std::int64_t>{2});
  EXPECT_EQ(taken(queue, kTwo[1]), std::vector<std::int64_t>{1});
}

TEST(JobQueue, APausedJobWaitsUntilItIsResumed) {
  JobQueue queue;
  queue.add({.id = 1});
  queue.add({.id = 2, .paused = true});
  queue.pause(1, true);
  EXPECT_TRUE(taken(queue).empty());
  queue.pause(2, false);
  EXPECT_EQ(taken(queue), std::vector<std::int64_t>{2});
  queue.pause_all(true);
  queue.pause(1, false);
  EXPECT_TRUE(taken(queue).empty());
  queue.pause_all(false);
  EXPECT_EQ(taken(queue), std::vector<std::int64_t>{1});
}

TEST(JobQueue, AJobThatKilledAWorkerIsForThatWorkerAloneAndLast) {
  JobQueue queue;
  queue.add({.id = 1, .tied_to = "large"});
  queue.add({.id = 2});
  EXPECT_EQ(queue.take(kTwo[0], kTwo, 1)->id, 2);
  EXPECT_FALSE(queue.take(kTwo[0], kTwo, 1));
  EXPECT_EQ(queue.take(kTwo[1], kTwo, 1)->id, 1);
  queue.add({.id = 3, .tied_to = "gone"});
  EXPECT_EQ(queue.take(kTwo[0], kTwo, 1)->id, 3) << "nobody waits for a worker that is not there";
}

TEST(JobQueue, EveryWaitingJobSaysWhy) {
  JobQueue queue;
  queue.add({.id = 1, .priority = Priority::Live});
  queue.add({.id = 2, .priority = Priority::Live});
  queue.add({.id = 3});
  queue.add({.id = 4, .not_before = 100});
  queue.add({.id = 5, .paused = true});
  queue.add({.id = 6, .priority = Priority::Scheduled, .need_mib = 24 * 1024});
  EXPECT_EQ(queue.why(3, kNobody, 1), "no worker connected");
  EXPECT_EQ(queue.why(3, kTwo, 1), "behind 2 live jobs");
  EXPECT_EQ(queue.why(2, kTwo, 1), "next in line, all workers are busy");
  EXPECT_EQ(queue.why(1, kTwo, 1), "behind 1 live job");
  EXPECT_EQ(queue.why(4, kTwo, 1), "back-off");
  EXPECT_EQ(queue.back_off_end(4, 1), 100);
  EXPECT_EQ(queue.why(5, kTwo, 1), "paused");
  EXPECT_EQ(queue.why(6, kTwo, 1), "needs 24 GiB, largest worker has 16 GiB");
  queue.pause_all(true);
  EXPECT_EQ(queue.why(3, kTwo, 1), "paused with all others");
}

// What the rules say, said again in the plainest way: which jobs may be taken now?
class Plain {
 public:
  std::map<std::int64_t, WaitingJob> jobs;
  bool paused_all = false;

  std::vector<std::int64_t> best(const Candidate& worker, std::int64_t now) const {
    const std::int64_t room =
        worker.memory_mib > 0 ? worker.memory_mib : std::numeric_limits<std::int64_t>::max();
    std::vector<const WaitingJob*> fit;
    for (const auto& [id, job] : jobs) {
      if (!paused_all && !job.paused && job.not_before <= now && job.need_mib <= room) fit.push_back(&job);
    }
    std::vector<std::int64_t> out;
    if (fit.empty()) return out;
    const Priority highest = (*std::ranges::max_element(fit, {}, &WaitingJob::priority))->priority;
    std::map<std::string, std::int64_t> first;  // of each share
    for (const WaitingJob* job : fit) {
      if (job->priority != highest) continue;
      if (highest == Priority::Live)
        first["all"] = job->id;  // ids rise
      else
        first.emplace(job->share, job->id);
    }
    for (const auto& [share, id] : first) out.push_back(id);
    return out;
  }
};

TEST(JobQueue, AgreesWithTheRulesOnRandomHistoriesAndLosesNothing) {
  const unsigned seed = std::random_device()();
  SCOPED_TRACE(seed);
  std::mt19937 random(seed);
  const auto up_to = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  for (int history = 0; history < 60; ++history) {
    JobQueue queue;
    Plain plain;
    std::int64_t now = 1, next_id = 1;
    int added = 0, came_out = 0, removed = 0;
    for (int step = 0; step < 300; ++step) {
      now += up_to(5);
      const int act = up_to(10);
      const std::int64_t some =
          plain.jobs.empty()
              ? 1
              : std::next(plain.jobs.begin(), up_to(static_cast<int>(plain.jobs.size())))->first;
      if (act < 4) {
        WaitingJob job{
            .id = next_id++, .priority = static_cast<Priority>(up_to(3)), .share = concat("s", up_to(4))};
        job.cost_s = 1 + up_to(3);
        job.need_mib = up_to(4);
        job.paused = up_to(8) == 0;
        if (up_to(4) == 0) job.not_before = now + up_to(30);
        queue.add(job);
        plain.jobs[job.id] = job;
        ++added;
      } else if (act == 4) {
        const bool pause = up_to(2) == 0;
        queue.pause(some, pause);
        if (plain.jobs.contains(some)) plain.jobs[some].paused = pause;
      } else if (act == 5 && up_to(4) == 0) {
        queue.pause_all(plain.paused_all = !plain.paused_all);
      } else if (act == 6 && up_to(3) == 0) {
        queue.remove(some);
        removed += static_cast<int>(plain.jobs.erase(some));
      } else {
        const Candidate worker{"w", up_to(5)};
        const auto allowed = plain.best(worker, now);
        const auto job = queue.take(worker, std::vector{worker}, now);
        ASSERT_EQ(job.has_value(), !allowed.empty()) << "history " << history << " step " << step;
        if (!job) continue;
        ASSERT_TRUE(std::ranges::find(allowed, job->id) != allowed.end()) << job->id;
        plain.jobs.erase(job->id);
        ++came_out;
      }
      ASSERT_EQ(queue.size(), static_cast<std::int64_t>(plain.jobs.size()));
    }
    queue.pause_all(false);
    for (const auto& [id, job] : plain.jobs) queue.pause(id, false);
    came_out += static_cast<int>(taken(queue, {"w", 0}, now + 1000).size());
    EXPECT_EQ(came_out + removed, added);
    EXPECT_EQ(queue.size(), 0);
  }
}

TEST(CostModel, ForetellsTheSameSetupByItsMedianAndItsMostMemory) {
  CostModel model;
  EXPECT_EQ(model.estimate({"a", "sirt", 100}).wall_s, 0);
  for (const double s : {2.0, 3.0, 50.0}) model.observe({"a", "sirt", 100}, {s, 10 * s});
  EXPECT_EQ(model.estimate({"a", "sirt", 100}).wall_s, 3);
  EXPECT_EQ(model.estimate({"a", "sirt", 100}).peak_mib, 500);
}

TEST(CostModel, ScalesFromTheRunNextInSize) {
  CostModel model;
  model.observe({"small", "sirt", 100}, {1, 50});
  model.observe({"large", "sirt", 10'000}, {200, 900});
  EXPECT_EQ(model.estimate({"new", "sirt", 200}).wall_s, 2);
  EXPECT_EQ(model.estimate({"new", "sirt", 200}).peak_mib, 100);
  EXPECT_EQ(model.estimate({"new", "sirt", 5'000}).wall_s, 100);
  EXPECT_EQ(model.estimate({"new", "sirt", 5'000}).peak_mib, 900) << "programs do not shrink";
  EXPECT_EQ(model.estimate({"new", "mart", 200}).wall_s, 0) << "another solver says nothing";
}

}  // namespace
}  // namespace flamefield
