#include <gtest/gtest.h>

#include <csignal>

#include "reconstruct/metrics.h"
#include "services/bus/client.h"
#include "services/dispatcher/dispatcher.h"
#include "services/ledger/reader.h"
#include "services/log/log.h"
#include "services/store/projection_file.h"
#include "services/store/volume_file.h"
#include "services/worker/best_so_far.h"
#include "services/worker/reconstruct_job.h"
#include "tests/services/chaos.h"
#include "tests/services/small_lab.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;
using testing_support::eventually;
using testing_support::SmallLab;

// Frames in, volumes out, all within one process.
TEST(Worker, MakesTheVolumeOfEverySetAndOfTheirMean) {
  set_log_level(LogLevel::Error);
  Scratch scratch;
  SmallLab lab;
  Bus bus;
  auto dispatcher = Dispatcher::open(bus, {.data_dir = scratch.path(), .segment_bytes = 1 << 20});
  ASSERT_TRUE(dispatcher) << dispatcher.error().message;
  std::jthread serving([&](std::stop_token stop) { (void)(*dispatcher)->run(stop); });
  auto client = Client::connect(bus, "operator", "c", "inproc://dispatcher");
  ASSERT_TRUE(client->ask(PutRig{lab.rig}, 5s));
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(client->ask(PutSet{lab.set("dark", CaptureKind::Dark, i)}, 5s));
    ASSERT_TRUE(client->ask(PutSet{lab.set("burst", CaptureKind::Burst, i)}, 5s));
  }
  Submit order;
  order.captures = {"burst"};
  order.processing = lab.processing(30);
  ASSERT_TRUE(client->ask(order, 5s));
  order.combine = Combine::Mean;
  ASSERT_TRUE(client->ask(order, 5s));
  std::jthread working([&](std::stop_token stop) {
    Worker worker(bus, {.name = {}, .data_dir = scratch.path(), .heartbeat = 100ms},
                  make_reconstruct_step({scratch.path(), 1}));
    (void)worker.run(stop);
  });
  ASSERT_TRUE(eventually([&] {
    const auto status = client->ask_for<Status>(GetStatus{}, 5s);
    return status && status->queued + status->leased == 0;
  }));
  auto reader = LedgerReader::open(scratch.path());
  const auto runs = reader->runs();
  ASSERT_TRUE(runs) << runs.error().message;
  ASSERT_EQ(runs->size(), 4u) << reader->receipt("burst")->failures.at(0).reason;
  for (const RunRow& row : *runs) {
    const auto volume = read_volume(scratch.path() / row.run.volume_path);
    ASSERT_TRUE(volume) << volume.error().message;
    EXPECT_GT(compare(lab.truth, *volume)->pearson, 0.9);
    const auto prepared = read_projections(scratch.path() / row.run.projections_path);
    ASSERT_TRUE(prepared) << prepared.error().message;
    EXPECT_EQ(prepared->views(), 5u);
    EXPECT_EQ(row.run.residual_per_view.size(), 5u);
    EXPECT_EQ(row.run.iterations, 30);
    EXPECT_GT(row.run.timings.solve_s, 0);
    ASSERT_EQ(row.run.history.size(), 30u);
    EXPECT_EQ(row.run.history.back().iteration, 30);
    EXPECT_LT(row.run.history.back().residual, row.run.history.front().residual);
  }
}

// The page shows it while the work goes on; afterwards there is only the run, with its history.
TEST(Worker, AnEvolutionShowsItsBestSoFarAndKeepsItsHistory) {
  set_log_level(LogLevel::Error);
  Scratch scratch;
  SmallLab lab;
  const auto step = make_reconstruct_step({scratch.path(), 1});
  Lease lease{7, 60'000, {}, lab.rig};
  lease.job.run_id = "burst-0000-0a1b2c3d";
  lease.job.inputs = {{"burst", 0}};
  lease.job.processing = lab.processing(30);
  lease.job.processing.recipe = {"ert", {{"ert.max_generations", std::int64_t{400}}}};
  std::optional<BestSoFar> seen;
  std::optional<Volume> best;
  const auto look = [&](const Progress& progress) {
    if (progress.stage != "solve" || best) return;
    seen = find_best_so_far(scratch.path());
    if (!seen) return;
    if (auto volume = read_volume(seen->path)) best = std::move(*volume);
  };
  const auto run = step({lease,
                         "w",
                         [&](std::span<const SetId>) {
                           return Result<std::vector<FrameSet>>({lab.set("burst", CaptureKind::Burst, 0)});
                         },
                         look,
                         {}});
  ASSERT_TRUE(run) << run.error().message;
  ASSERT_TRUE(best);
  EXPECT_EQ(seen->run_id, lease.job.run_id);
  EXPECT_EQ(best->grid.nx, lease.job.processing.grid.nx);
  EXPECT_FALSE(find_best_so_far(scratch.path()));
  ASSERT_GT(run->history.size(), 5u);
  EXPECT_LE(run->history.size(), kRunHistory);
  EXPECT_GT(run->history.back().fitness, run->history.front().fitness);
  EXPECT_EQ(run->history.back().iteration, run->iterations);
}

TEST(Worker, ABadRecipeFailsWithItsReason) {
  set_log_level(LogLevel::Error);
  Scratch scratch;
  SmallLab lab;
  Lease lease{1, 1000, {}, lab.rig};
  lease.job.run_id = "r";
  lease.job.inputs = {{"burst", 0}};
  lease.job.processing = lab.processing(3);
  lease.job.processing.recipe.settings["mlem.no_such_key"] = true;
  const auto fetch = [&](std::span<const SetId> ids) -> Result<std::vector<FrameSet>> {
    std::vector<FrameSet> sets;
    for (const SetId& id : ids) sets.push_back(lab.set(id.capture, CaptureKind::Burst, id.index));
    return sets;
  };
  const JobContext bad{lease, "w", fetch, [](const Progress&) {}, {}};
  const auto run = make_reconstruct_step({scratch.path(), 1})(bad);
  ASSERT_FALSE(run);
  EXPECT_EQ(run.error().code, ErrorCode::InvalidInput);
  EXPECT_NE(run.error().message.find("no_such_key"), std::string::npos) << run.error().message;
  EXPECT_TRUE(scratch.is_empty());
}

// The programs themselves, as processes over TCP, killed with -9 while they work.
TEST(Programs, KilledAFewTimesLoseNothingAndCommitNothingTwice) {
  testing_support::expect_survival(
      {.sets = 20, .dispatcher_kills = 1, .worker_kills = 2, .cuts = 1, .freezes = 0});
}

TEST(Programs, StopCleanlyOnRequest) {
  Scratch scratch;
  const std::string data = scratch.path().string();
  testing_support::Process dispatcher(
      "flamefield-dispatchd",
      {"--data", data, "--endpoint", "ipc://" + data + "/bus", "--events", "ipc://" + data + "/events"},
      scratch.path() / "log");
  ASSERT_TRUE(eventually([&] { return std::filesystem::exists(scratch.path() / "bus"); }));
  testing_support::Process worker(
      "flamefield-worker", {"--data", data, "--endpoint", "ipc://" + data + "/bus"}, scratch.path() / "log");
  Bus bus(KeyRing::open(scratch.path() / "keys", "operator").value());
  auto client = Client::connect(bus, "operator", "c", "ipc://" + data + "/bus");
  ASSERT_TRUE(eventually([&] {
    const auto status = client->ask_for<Status>(GetStatus{}, 1s);
    return status && !status->workers.empty();
  }));
  worker.signal(SIGTERM);
  EXPECT_EQ(worker.wait(), 0);
  dispatcher.signal(SIGINT);
  EXPECT_EQ(dispatcher.wait(), 0);
}

}  // namespace
}  // namespace flamefield
