// Priorities, pauses, cancelling, dead letters, and what a job needs: through a running dispatcher.
#include <gtest/gtest.h>

#include <future>
#include <mutex>

#include "tests/services/dispatcher_fixture.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;
using testing_support::DispatcherTest;
using testing_support::eventually;
using testing_support::make_processing;
using testing_support::make_rig;
using testing_support::make_set;
using testing_support::small_step;

class DispatcherControl : public DispatcherTest {
 protected:
  std::string why(std::int64_t job) {
    for (const auto& waiting : ask<Status>(GetStatus{}).waiting) {
      if (waiting.job_id == job) return waiting.why;
    }
    return "does not wait";
  }
  std::int64_t control(JobAction action, std::vector<std::int64_t> jobs, bool all = false) {
    return ask<JobsControlled>(ControlJobs{action, std::move(jobs), 0, all}).changed;
  }
};

TEST_F(DispatcherControl, APausedJobWaitsSaysSoAlsoAfterARestartAndGoesOnWhenResumed) {
  put_sets(2);
  const auto ids = submit().job_ids;
  EXPECT_EQ(control(JobAction::Pause, {ids[0]}), 1);
  stop();
  start();
  const auto worker = start_worker(good_step());
  EXPECT_TRUE(eventually([&] { return ask<Status>(GetStatus{}).runs == 1; }));
  EXPECT_EQ(why(ids[0]), "paused");
  EXPECT_EQ(control(JobAction::Resume, {ids[0]}), 1);
  EXPECT_TRUE(all_done(2));
}

TEST_F(DispatcherControl, WhileEverythingIsPausedLaterJobsWaitToo) {
  put_sets(1);
  EXPECT_EQ(control(JobAction::Pause, {}, true), 0);
  EXPECT_TRUE(ask<Status>(GetStatus{}).paused);
  const auto worker = start_worker(good_step());
  const auto ids = submit().job_ids;
  EXPECT_TRUE(eventually([&] { return !ask<Status>(GetStatus{}).workers.empty(); }));
  EXPECT_EQ(why(ids[0]), "paused with all others");
  control(JobAction::Resume, {}, true);
  EXPECT_TRUE(all_done(1));
}

TEST_F(DispatcherControl, ACancelledJobStopsWhileItRunsAndIsANamedFailure) {
  put_sets(1);
  const auto ids = submit().job_ids;
  std::promise<void> started;
  const auto worker = start_worker([&](const JobContext& context) -> Result<flamefield::Run> {
    started.set_value();
    EXPECT_TRUE(eventually([&] { return context.stop.stop_requested(); }));
    return unavailable("job", "stopped", "do it again");
  });
  started.get_future().wait();
  EXPECT_EQ(control(JobAction::Cancel, ids), 1);
  const auto receipt = reader().receipt("burst");
  EXPECT_TRUE(receipt->balances());
  ASSERT_EQ(receipt->failures.size(), 1u);
  EXPECT_EQ(receipt->failures[0].reason, "cancelled");
  EXPECT_TRUE(eventually([&] { return ask<Status>(GetStatus{}).workers.at(0).job_id == 0; }));
  EXPECT_EQ(ask<Status>(GetStatus{}).failed, 1) << "what the worker says later changes nothing";
}

TEST_F(DispatcherControl, ADeadLetterIsListedWithItsReasonAndCanBePutBack) {
  put_sets(1);
  const Submitted submitted = submit();
  std::atomic<bool> mended = false;
  const auto worker = start_worker([&](const JobContext& context) -> Result<flamefield::Run> {
    if (!mended) return invalid_input("recipe", "it is broken", "mend it");
    return small_step(scratch_.path(), context);
  });
  ASSERT_TRUE(eventually([&] { return ask<Status>(GetStatus{}).failed == 1; }));
  const auto dead = ask<Jobs>(GetJobs{.state = JobState::Failed});
  ASSERT_EQ(dead.rows.size(), 1u);
  EXPECT_NE(dead.rows[0].why.find("it is broken"), std::string::npos);
  EXPECT_EQ(dead.rows[0].submission, submitted.submission);
  mended = true;
  EXPECT_EQ(control(JobAction::Retry, {dead.rows[0].id}), 1);
  EXPECT_TRUE(all_done(1));
}

TEST_F(DispatcherControl, AFailedAttemptWaitsAndSaysUntilWhenAndWhy) {
  stop();
  options_.back_off = 1h;
  start();
  put_sets(1);
  const auto ids = submit().job_ids;
  const auto worker = start_worker(
      [&](const JobContext&) -> Result<flamefield::Run> { return unavailable("disk", "full", "wait"); });
  EXPECT_TRUE(eventually([&] { return why(ids[0]).starts_with("back-off until 2"); })) << why(ids[0]);
  EXPECT_NE(why(ids[0]).find("full"), std::string::npos);
}

TEST_F(DispatcherControl, LiveSetsThatWorkersCannotFollowAreMadeNewestFirstAndAllOfThem) {
  ask<RigStored>(PutRig{make_rig()});
  ask<Accepted>(LivePlan{true, make_processing()});
  put_sets(5, "live", CaptureKind::Live);
  put_sets(1, "burst", CaptureKind::Board);
  submit();
  std::mutex mutex;
  std::vector<std::int64_t> order;
  const auto worker = start_worker([&](const JobContext& context) -> Result<flamefield::Run> {
    const std::lock_guard lock(mutex);
    order.push_back(context.lease.job.priority == Priority::Live ? context.lease.job.inputs[0].index : 99);
    return small_step(scratch_.path(), context);
  });
  ASSERT_TRUE(all_done(6));
  EXPECT_EQ(order, (std::vector<std::int64_t>{4, 3, 2, 1, 0, 99}));
}

TEST_F(DispatcherControl, AJobThatNeedsMoreMemoryThanAnyWorkerHasWaitsAndSaysSo) {
  put_sets(2);
  ask<RigStored>(PutRig{make_rig()});
  Submit order;
  order.sets = {{"burst", 0}};
  order.processing = make_processing();
  const auto hungry = [&](const JobContext& context) -> Result<flamefield::Run> {
    auto run = small_step(scratch_.path(), context);
    run->peak_rss_mib = 12 * 1024;
    run->timings.solve_s = 3;
    run->estimated_mib = context.lease.job.estimated_mib;
    run->estimated_s = context.lease.job.estimated_s;
    return run;
  };
  ask<Submitted>(order);
  {
    const auto first = start_worker(hungry, 8 * 1024);
    ASSERT_TRUE(all_done(1)) << "nothing is known of such work yet";
  }
  const auto small = start_worker(hungry, 8 * 1024);
  order.sets = {{"burst", 1}};
  const auto ids = ask<Submitted>(order).job_ids;
  ASSERT_TRUE(eventually([&] { return why(ids[0]) == "needs 12 GiB, largest worker has 8 GiB"; }))
      << why(ids[0]);
  const auto large = start_worker(hungry, 16 * 1024);
  ASSERT_TRUE(all_done(2));
  const auto runs = reader().runs();
  EXPECT_EQ(runs->at(1).run.estimated_mib, 12 * 1024) << "the estimate is kept beside the truth";
  EXPECT_EQ(runs->at(1).run.estimated_s, 3);
}

TEST_F(DispatcherControl, AJobThatKillsItsWorkersProcessTwiceIsADeadLetter) {
  put_sets(1);
  submit();
  auto worker = Client::connect(bus_, "worker", "w", "inproc://dispatcher");
  for (int life = 0; life < 2; ++life) {
    ASSERT_TRUE(worker->tell(Ready{"w", "0.1.0", 1}));
    const auto lease = worker->next(5s);
    ASSERT_TRUE(lease) << life;
    Fail fail{std::get<Lease>(*lease).token, {}, true};
    fail.error = unavailable("the worker's process died of this job", "signal 11", "").value();
    ASSERT_TRUE(worker->ask(fail, 5s));
  }
  const auto dead = ask<Jobs>(GetJobs{.state = JobState::Failed});
  ASSERT_EQ(dead.rows.size(), 1u);
  EXPECT_NE(dead.rows[0].why.find("signal 11"), std::string::npos);
  EXPECT_EQ(ask<Status>(GetStatus{}).counters.at("worker_crashes"), 2);
}

}  // namespace
}  // namespace flamefield
