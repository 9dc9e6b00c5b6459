// Workers that were hired for a time, and what the dispatcher asks of a worker before it gets work.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>

#include "proto/utc.h"
#include "proto/version.h"
#include "services/dispatcher/roster.h"
#include "services/store/data_id.h"
#include "tests/services/dispatcher_fixture.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;
using namespace testing_support;

// Told apart from the fixture's: with a time to end, and with a stop and a drain of its own.
class HiredWorker : public DispatcherTest {
 protected:
  WorkerOptions hired() const {
    return {.name = "pilot-1", .data_dir = scratch_.path(), .heartbeat = 50ms, .patience = 2s};
  }
};

TEST_F(HiredWorker, EndsWhenThereIsNothingLeftToDo) {
  put_sets(3);
  submit();
  WorkerOptions options = hired();
  options.idle_limit = 1s;
  Worker worker(bus_, options, good_step());
  EXPECT_TRUE(worker.run({}));
  EXPECT_EQ(ask<Status>(GetStatus{}).done, 3);
}

TEST_F(HiredWorker, DrainingItFinishesTheJobInHandAndTakesNoOther) {
  put_sets(3);
  submit();
  std::stop_source drain;
  std::atomic<int> begun = 0;
  Worker worker(bus_, hired(), [&](const JobContext& context) {
    ++begun;
    drain.request_stop();
    return small_step(scratch_.path(), context);
  });
  EXPECT_TRUE(worker.run({}, drain.get_token()));
  EXPECT_EQ(begun, 1);
  const Status status = ask<Status>(GetStatus{});
  EXPECT_EQ(status.done, 1);
  EXPECT_EQ(status.queued, 2);
}

TEST_F(HiredWorker, EndsWithAnErrorWhenTheDispatcherIsSilent) {
  stop();
  WorkerOptions options = hired();
  options.silence_limit = 1s;
  Worker worker(bus_, options, good_step());
  const auto end = worker.run({});
  ASSERT_FALSE(end);
  EXPECT_EQ(end.error().code, ErrorCode::Unavailable);
  EXPECT_NE(end.error().message.find("pilot-1 heard nothing of the dispatcher for 1 s"), std::string::npos)
      << end.error().message;
}

TEST_F(HiredWorker, AnAnswerToItsIdleWordsKeepsItFromEnding) {
  WorkerOptions options = hired();
  options.silence_limit = 1s;
  std::stop_source stop;
  const auto began = std::chrono::steady_clock::now();
  std::jthread later([&] {
    eventually([&] { return std::chrono::steady_clock::now() - began > 2500ms; });
    stop.request_stop();
  });
  Worker worker(bus_, options, good_step());
  const auto end = worker.run(stop.get_token());
  EXPECT_TRUE(end) << end.error().message;
}

TEST_F(HiredWorker, OneThatWouldWriteElsewhereIsRefusedByNameAndRecorded) {
  const Scratch elsewhere;
  WorkerOptions options = hired();
  options.data_dir = elsewhere.path();
  Worker nowhere(bus_, options, good_step());
  const auto none = nowhere.run({});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::InvalidInput);
  EXPECT_NE(none.error().message.find("pilot-1"), std::string::npos) << none.error().message;
  std::filesystem::create_directories(elsewhere / "volumes");
  ASSERT_TRUE(make_data_id(elsewhere.path()));
  Worker other(bus_, options, good_step());
  const auto another = other.run({});
  ASSERT_FALSE(another);
  EXPECT_NE(another.error().message, none.error().message);
  EXPECT_EQ(ask<Status>(GetStatus{}).counters["workers_refused"], 2);
  int told = 0;
  const auto diary = reader().events().value();
  for (const Event& event : diary) told += event.kind == "worker-refused" && event.subject == "pilot-1";
  EXPECT_EQ(told, 2);
}

TEST_F(HiredWorker, ADirectoryKeepsItsNameOverRestarts) {
  const std::string id = read_data_id(scratch_.path());
  EXPECT_NE(id, kNoDataId);
  stop();
  start();
  EXPECT_EQ(read_data_id(scratch_.path()), id);
}

// --- the roster's arithmetic

Ready told(const std::string& name, const std::string& host, std::int64_t memory_mib, bool own) {
  Ready ready{name, std::string(program_version()), 1};
  ready.host = host;
  ready.memory_mib = memory_mib;
  ready.own_memory = own;
  return ready;
}

TEST(Roster, WorkersOfOneHostShareItsMemoryUnlessItIsTheirOwn) {
  for (const bool own : {false, true}) {
    Roster roster;
    const auto now = Roster::Clock::now();
    roster.ready("a", told("a", "host", 1000, own), false, now);
    roster.ready("b", told("b", "host", 1000, own), false, now);
    roster.lease("a", 7, 1, 700, now + 10s);
    EXPECT_EQ(roster.candidate("b").memory_mib, own ? 1000 : 300);
    EXPECT_EQ(roster.candidate("a").memory_mib, 300);
    roster.ready("a", told("a", "other host", 1000, own), false, now);
    EXPECT_EQ(roster.candidate("b").memory_mib, 1000) << "it moved";
    roster.end(7);
    EXPECT_EQ(roster.candidate("a").memory_mib, 1000);
    roster.lease("a", 8, 1, 400, now + 10s);
    roster.gone("a");
    EXPECT_EQ(roster.candidate("b").memory_mib, 1000) << "what is gone needs nothing";
  }
}

TEST(Roster, LeasesEndInTheOrderOfTheirDeadlinesAndHeartbeatsMoveThem) {
  Roster roster;
  const auto now = Roster::Clock::now();
  for (const char* name : {"a", "b", "c"}) roster.ready(name, told(name, name, 0, false), false, now);
  EXPECT_EQ(roster.idle(), (std::vector<std::string>{"a", "b", "c"}));
  roster.lease("b", 1, 11, 0, now + 3s);
  roster.lease("a", 2, 12, 0, now + 1s);
  roster.lease("c", 3, 13, 0, now + 2s);
  EXPECT_TRUE(roster.idle().empty());
  EXPECT_TRUE(roster.expired(now).empty());
  EXPECT_EQ(roster.expired(now + 2s), (std::vector<std::int64_t>{2, 3}));
  EXPECT_TRUE(roster.extend(2, now + 9s));
  EXPECT_EQ(roster.expired(now + 4s), (std::vector<std::int64_t>{3, 1}));
  roster.end(3);
  EXPECT_EQ(roster.expired(now + 4s), (std::vector<std::int64_t>{1}));
  EXPECT_FALSE(roster.extend(3, now + 9s));
  roster.void_leases();
  EXPECT_TRUE(roster.expired(now + 99s).empty());
  roster.ready("c", told("c", "c", 0, false), false, now);
  EXPECT_EQ(roster.idle(), (std::vector<std::string>{"c"}));
  roster.drop_silent(now + 1s);
  EXPECT_TRUE(roster.idle().empty());
  EXPECT_TRUE(roster.candidates().empty());
}

TEST(JobQueue, AWorkerForLiveWorkTakesNothingElse) {
  JobQueue queue;
  queue.add({.id = 1, .priority = Priority::Interactive});
  const Candidate reserved{"r", 0, true};
  EXPECT_FALSE(queue.take(reserved, {}, 1));
  EXPECT_EQ(queue.why(1, std::vector{reserved}, 1), "no worker connected but those for live work");
  queue.add({.id = 2, .priority = Priority::Live});
  EXPECT_EQ(queue.take(reserved, {}, 1)->id, 2);
  EXPECT_EQ(queue.take({"w", 0}, {}, 1)->id, 1);
}

TEST(Keys, AKeyThatIsOutOfDateIsListedButNotLetIn) {
  const Scratch keys, remote;
  ASSERT_TRUE(KeyRing::open_or_create(keys.path()));
  ASSERT_TRUE(make_keys_for(keys.path(), "worker", remote / "w"));
  const std::int64_t now_s = utc_now_ns() / 1'000'000'000;
  ASSERT_TRUE(allow_key(keys.path(), "worker", "late", remote / "w/worker.pub", now_s - 1));
  const std::size_t without = read_allow_list(keys.path())->size();
  ASSERT_TRUE(allow_key(keys.path(), "worker", "early", remote / "w/worker.pub", now_s + 1000));
  EXPECT_EQ(read_allow_list(keys.path())->size(), without + 1);
  const auto listed = list_keys(keys.path());
  ASSERT_TRUE(listed);
  const auto late = std::ranges::find(*listed, "late", &KeyEntry::name);
  ASSERT_NE(late, listed->end());
  EXPECT_EQ(late->expires_s, now_s - 1);
  overwrite(keys / "worker-late.pub", std::string(40, 'a') + "\nexpires soon\n");
  EXPECT_FALSE(read_allow_list(keys.path())) << "a date that is none";
}

}  // namespace
}  // namespace flamefield
