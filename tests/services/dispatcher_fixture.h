#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <optional>

#include "services/bus/client.h"
#include "services/dispatcher/dispatcher.h"
#include "services/ledger/reader.h"
#include "services/log/log.h"
#include "services/worker/worker.h"
#include "tests/services/support.h"

namespace flamefield::testing_support {

using namespace std::chrono_literals;

// A step that writes a file and checks that the pixels are the set's.
inline Result<flamefield::Run> small_step(const std::filesystem::path& data_dir, const JobContext& context) {
  const Job& job = context.lease.job;
  const auto sets = context.fetch(job.inputs);
  if (!sets) return tl::unexpected(sets.error());
  for (const FrameSet& set : *sets) {
    if (!same_pixels(set, make_set(set.capture, set.index, 8, set.kind)))
      return invalid_input("pixels", "they are not those of the set", "");
  }
  flamefield::Run run;
  run.id = job.run_id;
  run.job_id = job.id;
  run.inputs = job.inputs;
  run.processing = job.processing;
  run.worker = context.worker;
  run.volume_path = "volumes/" + run.id + ".vtkhdf";
  std::ofstream(data_dir / staged_path(run.volume_path, context.lease.token)) << context.lease.token;
  return run;
}

// A dispatcher in a thread, on a scratch directory. stop() and start() are a restart.
class DispatcherTest : public ::testing::Test {
 protected:
  void SetUp() override {
    set_log_level(LogLevel::Error);
    options_.data_dir = scratch_.path();
    options_.lease = 500ms;
    options_.back_off = 10ms;
    options_.segment_bytes = 1 << 20;
    start();
  }
  void TearDown() override { stop(); }

  void start() {
    auto opened = Dispatcher::open(bus_, options_);
    // ZeroMQ lets go of a closed endpoint a moment later.
    eventually(
        [&] {
          if (!opened) opened = Dispatcher::open(bus_, options_);
          return opened.has_value();
        },
        2s);
    ASSERT_TRUE(opened) << opened.error().message;
    dispatcher_ = std::move(*opened);
    thread_ = std::jthread([this](std::stop_token stop) { EXPECT_TRUE(dispatcher_->run(stop)); });
    client_.emplace(Client::connect(bus_, "operator", unique_name("client"), "inproc://dispatcher").value());
  }
  void stop() {
    client_.reset();
    thread_ = {};
    dispatcher_.reset();
  }

  template <class Answer>
  Answer ask(const Message& question) {
    auto answer = client_->ask_for<Answer>(question, 5s);
    EXPECT_TRUE(answer) << answer.error().message;
    return answer ? *answer : Answer{};
  }
  void put_sets(int count, const std::string& capture = "burst", CaptureKind kind = CaptureKind::Burst) {
    for (int i = 0; i < count; ++i) {
      const FrameSet set = make_set(capture, i, 8, kind);
      EXPECT_FALSE(ask<SetStored>(PutSet{set}).already_there);
    }
  }
  Submitted submit(Combine combine = Combine::Each) {
    ask<RigStored>(PutRig{make_rig()});
    Submit order;
    order.captures = {"burst"};
    order.combine = combine;
    order.processing = make_processing();
    return ask<Submitted>(order);
  }
  std::jthread start_worker(JobStep step, std::int64_t memory_mib = 0) {
    return std::jthread([this, memory_mib, step = std::move(step)](std::stop_token stop) {
      WorkerOptions options{.name = {}, .data_dir = scratch_.path(), .heartbeat = 50ms, .patience = 2s};
      options.memory_mib = memory_mib;
      Worker worker(bus_, options, step);
      EXPECT_TRUE(worker.run(stop));
    });
  }
  JobStep good_step() {
    return [dir = scratch_.path()](const JobContext& context) { return small_step(dir, context); };
  }
  bool all_done(std::int64_t runs) {
    return eventually([&] {
      const Status status = ask<Status>(GetStatus{});
      return status.runs == runs && status.queued + status.leased == 0;
    });
  }
  LedgerReader reader() { return LedgerReader::open(scratch_.path()).value(); }

  Scratch scratch_;
  Bus bus_;
  DispatcherOptions options_;
  std::unique_ptr<Dispatcher> dispatcher_;
  std::jthread thread_;
  std::optional<Client> client_;
};

}  // namespace flamefield::testing_support
