#include "services/dispatcher/dispatcher.h"

#include <gtest/gtest.h>

#include <future>
#include <optional>

#include "services/dispatcher/set_sender.h"
#include "tests/services/dispatcher_fixture.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;
using testing_support::DispatcherTest;
using testing_support::eventually;
using testing_support::make_processing;
using testing_support::make_rig;
using testing_support::make_set;
using testing_support::same_pixels;
using testing_support::small_step;

TEST_F(DispatcherTest, ASetSentTwiceIsStoredOnce) {
  put_sets(1);
  EXPECT_TRUE(ask<SetStored>(PutSet{make_set("burst", 0)}).already_there);
  EXPECT_EQ(ask<Status>(GetStatus{}).sets, 1);
  EXPECT_TRUE(same_pixels(ask<SetData>(FetchSet{{"burst", 0}}).set, make_set("burst", 0)));
}

TEST_F(DispatcherTest, EverySetBecomesAVolumeAndTheReceiptBalances) {
  put_sets(12);
  EXPECT_EQ(submit().job_ids.size(), 12u);
  const auto first = start_worker(good_step()), second = start_worker(good_step());
  ASSERT_TRUE(all_done(12));
  const auto receipt = reader().receipt("burst");
  ASSERT_TRUE(receipt);
  EXPECT_TRUE(receipt->balances());
  EXPECT_EQ(receipt->volumes, 12);
  const auto runs = reader().runs();
  ASSERT_TRUE(runs);
  for (const RunRow& row : *runs) EXPECT_TRUE(std::filesystem::exists(scratch_.path() / row.run.volume_path));
  for (const auto& entry : std::filesystem::directory_iterator(scratch_.path() / "volumes"))
    EXPECT_EQ(entry.path().string().find(".part-"), std::string::npos) << entry.path();
}

TEST_F(DispatcherTest, WithTheLivePlanSetsBecomeVolumesByThemselves) {
  ask<RigStored>(PutRig{make_rig()});
  ask<Accepted>(LivePlan{true, make_processing()});
  const auto worker = start_worker(good_step());
  put_sets(4, "live", CaptureKind::Live);
  put_sets(2, "dark", CaptureKind::Dark);
  ask<Accepted>(LivePlan{false, {}});
  put_sets(1, "later");
  EXPECT_TRUE(all_done(4));
  EXPECT_EQ(reader().receipt("live")->volumes, 4);
  EXPECT_EQ(reader().receipt("later")->not_asked, 1);
}

TEST_F(DispatcherTest, IdenticalWorkIsSkipped) {
  put_sets(3);
  const Submitted first = submit(), second = submit(), mean = submit(Combine::Mean);
  EXPECT_EQ(first.job_ids.size(), 3u);
  EXPECT_EQ(second.job_ids.size(), 0u);
  EXPECT_EQ(second.identical, 3);
  EXPECT_EQ(second.run_ids, first.run_ids);
  EXPECT_EQ(mean.job_ids.size(), 1u);
  const auto worker = start_worker(good_step());
  ASSERT_TRUE(all_done(4));
  EXPECT_EQ(submit().identical, 3);
  EXPECT_EQ(reader().receipt("burst")->combined_volumes, 1);
}

TEST_F(DispatcherTest, ARefusedOrderLeavesNoTrace) {
  put_sets(2);
  ask<RigStored>(PutRig{make_rig()});
  Submit order;
  order.sets = {{"burst", 0}, {"burst", 1}, {"burst", 9}};
  order.processing = make_processing();
  const auto refused = client_->ask(order, 5s);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::NotFound);
  EXPECT_EQ(ask<Status>(GetStatus{}).queued, 0);
  order.sets = {{"burst", 0}};
  order.processing.dark_capture = "never-taken";
  EXPECT_EQ(client_->ask(order, 5s).error().code, ErrorCode::NotFound);
}

TEST_F(DispatcherTest, AJobThatCannotWorkFailsOnceWithItsReason) {
  put_sets(1);
  submit();
  std::atomic<int> attempts = 0;
  const auto worker = start_worker([&](const JobContext&) -> Result<flamefield::Run> {
    ++attempts;
    return invalid_input("grid", "it is empty", "mend it");
  });
  EXPECT_TRUE(eventually([&] { return ask<Status>(GetStatus{}).failed == 1; }));
  EXPECT_EQ(attempts, 1);
  const auto receipt = reader().receipt("burst");
  EXPECT_TRUE(receipt->balances());
  ASSERT_EQ(receipt->failures.size(), 1u);
  EXPECT_NE(receipt->failures[0].reason.find("it is empty"), std::string::npos);
}

TEST_F(DispatcherTest, WhatMayWorkLaterIsTriedAgain) {
  put_sets(1);
  submit();
  std::atomic<int> attempts = 0;
  const auto worker = start_worker([&](const JobContext& context) -> Result<flamefield::Run> {
    if (++attempts < 3) return unavailable("disk", "full", "wait");
    return small_step(scratch_.path(), context);
  });
  EXPECT_TRUE(all_done(1));
  EXPECT_EQ(attempts, 3);
}

TEST_F(DispatcherTest, AStepThatThrowsFailsItsJobOnly) {
  put_sets(2);
  submit();
  const auto worker = start_worker([&](const JobContext& context) -> Result<flamefield::Run> {
    if (context.lease.job.inputs[0].index == 0) throw std::runtime_error("surprise");
    return small_step(scratch_.path(), context);
  });
  EXPECT_TRUE(eventually([&] {
    const Status status = ask<Status>(GetStatus{});
    return status.failed == 1 && status.runs == 1;
  }));
}

// A worker that takes a job and is never heard of again.
TEST_F(DispatcherTest, TheJobOfASilentWorkerGoesToAnother) {
  put_sets(1);
  submit();
  auto silent = Client::connect(bus_, "worker", "silent", "inproc://dispatcher");
  ASSERT_TRUE(silent->tell(Ready{"silent", std::string("0.1.0"), 1}));
  std::optional<Lease> lease;
  ASSERT_TRUE(eventually([&] {
    auto message = silent->next(50ms);
    if (auto* given = message ? std::get_if<Lease>(&*message) : nullptr) lease = *given;
    return lease.has_value();
  }));
  const auto worker = start_worker(good_step());
  ASSERT_TRUE(all_done(1));
  EXPECT_EQ(ask<Status>(GetStatus{}).counters.at("leases_expired"), 1);

  // Late, it is refused, and told so when it beats.
  flamefield::Run run;
  run.id = lease->job.run_id;
  run.inputs = lease->job.inputs;
  run.processing = lease->job.processing;
  run.volume_path = "volumes/x.vtkhdf";
  const auto refused = silent->ask(Finish{lease->token, run}, 5s);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::InvalidInput);
  ASSERT_TRUE(silent->tell(Heartbeat{{.token = lease->token, .run_id = {}, .stage = {}}}));
  const auto lost = silent->next(5s);
  ASSERT_TRUE(lost);
  EXPECT_EQ(std::get<LeaseLost>(*lost).token, lease->token);
  EXPECT_EQ(ask<Status>(GetStatus{}).counters.at("stale_commits_refused"), 1);
  EXPECT_EQ(ask<Status>(GetStatus{}).runs, 1);
}

TEST_F(DispatcherTest, HeartbeatsKeepALongJobAlive) {
  put_sets(1);
  submit();
  const auto worker = start_worker([&](const JobContext& context) -> Result<flamefield::Run> {
    const auto end = std::chrono::steady_clock::now() + 3 * options_.lease;
    eventually([&] { return context.stop.stop_requested() || std::chrono::steady_clock::now() > end; });
    return small_step(scratch_.path(), context);
  });
  ASSERT_TRUE(all_done(1));
  EXPECT_EQ(ask<Status>(GetStatus{}).counters.count("leases_expired"), 0u);
  EXPECT_EQ(reader().jobs()->at(0).attempt, 1);
}

TEST_F(DispatcherTest, AWorkerThatStopsGivesItsJobBackAtOnce) {
  put_sets(1);
  submit();
  std::promise<void> started;
  {
    const auto worker = start_worker([&](const JobContext& context) -> Result<flamefield::Run> {
      started.set_value();
      eventually([&] { return context.stop.stop_requested(); });
      return unavailable("job", "stopped", "do it again");
    });
    started.get_future().wait();
  }
  const auto worker = start_worker(good_step());
  EXPECT_TRUE(all_done(1));
  EXPECT_EQ(ask<Status>(GetStatus{}).counters.count("leases_expired"), 0u);
}

TEST_F(DispatcherTest, AfterARestartNothingIsLostAndOldLeasesAreVoid) {
  put_sets(3);
  submit();
  std::optional<Lease> lease;
  {
    auto worker = Client::connect(bus_, "worker", "w", "inproc://dispatcher");
    ASSERT_TRUE(worker->tell(Ready{"w", "0.1.0", 1}));
    const auto message = worker->next(5s);
    ASSERT_TRUE(message);
    lease = std::get<Lease>(*message);
  }
  stop();
  start();
  flamefield::Run run;
  run.id = lease->job.run_id;
  run.inputs = lease->job.inputs;
  run.processing = lease->job.processing;
  run.volume_path = "volumes/x.vtkhdf";
  EXPECT_FALSE(client_->ask(Finish{lease->token, run}, 5s));
  EXPECT_EQ(ask<Status>(GetStatus{}).queued, 3);
  const auto worker = start_worker(good_step());
  EXPECT_TRUE(all_done(3));
}

TEST_F(DispatcherTest, WaitingJobsSayWhy) {
  put_sets(1);
  submit();
  const Status status = ask<Status>(GetStatus{});
  ASSERT_EQ(status.waiting.size(), 1u);
  EXPECT_EQ(status.waiting[0].why, "no worker connected");
}

TEST_F(DispatcherTest, AWorkerOfAnotherVersionIsTurnedAway) {
  auto worker = Client::connect(bus_, "worker", "old", "inproc://dispatcher");
  ASSERT_TRUE(worker->tell(Ready{"old", "0.0.1", 1}));
  const auto answer = worker->next(5s);
  ASSERT_TRUE(answer);
  EXPECT_TRUE(std::holds_alternative<Rejected>(*answer));
}

TEST_F(DispatcherTest, ASecondDispatcherOnTheSameDataIsRefused) {
  const auto second = Dispatcher::open(bus_, options_);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::Unavailable);
  EXPECT_NE(second.error().message.find("ledger"), std::string::npos);
}

TEST_F(DispatcherTest, AnEndpointInUseIsNamed) {
  Scratch other;
  DispatcherOptions options = options_;
  options.data_dir = other.path();
  const auto second = Dispatcher::open(bus_, options);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().message.find("inproc://dispatcher"), std::string::npos);
}

TEST_F(DispatcherTest, ASenderKeepsSetsUntilTheyAreStored) {
  stop();
  Dealer dealer(bus_, "capture", "capture");
  ASSERT_TRUE(dealer.connect("inproc://dispatcher"));
  SetSender sender(std::move(dealer), {.max_unacked = 4, .resend_after = 50ms});
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(sender.offer(make_set("burst", i)));
  EXPECT_EQ(sender.offer(make_set("burst", 4)).error().code, ErrorCode::Unavailable);
  EXPECT_FALSE(sender.drain(100ms));
  EXPECT_EQ(sender.unacked(), 4u);
  start();
  EXPECT_TRUE(sender.drain(5s)) << sender.last_refusal();
  EXPECT_EQ(sender.acked(), 4);
  EXPECT_EQ(ask<Status>(GetStatus{}).sets, 4);
}

TEST(DispatcherRoles, AWorkersKeyMayNotStoreSets) {
  set_log_level(LogLevel::Error);
  Scratch scratch;
  Bus bus(KeyRing::open_or_create(scratch.path() / "keys").value());
  auto dispatcher = Dispatcher::open(
      bus, {.data_dir = scratch.path() / "data", .endpoints = {"tcp://127.0.0.1:*"}, .event_endpoints = {}});
  ASSERT_TRUE(dispatcher) << dispatcher.error().message;
  std::jthread thread([&](std::stop_token stop) { (void)(*dispatcher)->run(stop); });
  auto worker = Client::connect(bus, "worker", "w", (*dispatcher)->endpoints()[0]);
  auto refused = worker->ask(PutSet{make_set("burst", 0)}, 5s);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::InvalidInput);
  auto producer = Client::connect(bus, "capture", "p", (*dispatcher)->endpoints()[0]);
  EXPECT_TRUE(producer->ask(PutSet{make_set("burst", 0)}, 5s));
}

}  // namespace
}  // namespace flamefield
