#include "services/bench/queue_bench.h"

#include <algorithm>
#include <ctime>
#include <fstream>
#include <memory>
#include <thread>
#include <vector>

#include "services/bench/stopwatch.h"
#include "services/bus/client.h"
#include "services/dispatcher/dispatcher.h"
#include "services/dispatcher/set_sender.h"
#include "services/ledger/ledger.h"
#include "services/ledger/reader.h"
#include "services/worker/worker.h"

namespace flamefield {

namespace {

using namespace std::chrono_literals;

constexpr auto kPatience = 60s;
constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'000;

Rig one_camera() {
  Camera camera;
  camera.name = "cam00";
  camera.image_width_px = camera.image_height_px = 8;
  camera.fx_px = camera.fy_px = 40;
  camera.cx_px = camera.cy_px = 3.5;
  camera.camera_from_world.translation_mm = {0, 0, 300};
  Rig rig;
  rig.cameras = {camera};
  return rig;
}

FrameSet small_set(const std::string& capture, std::int64_t index) {
  static const auto pixels = std::make_shared<const std::vector<std::byte>>(64);
  FrameSet set;
  set.capture = capture;
  set.index = set.pulse = index;
  set.pulse_time_ns = kStart_ns + index * 200'000'000;
  set.complete_time_ns = set.pulse_time_ns + 5'000'000;
  set.frames = {{.camera = "cam00", .pulse = index, .width_px = 8, .height_px = 8, .bytes = pixels}};
  return set;
}

Processing processing_of(const std::string& solver) {
  Processing processing;
  processing.rig_id = fingerprint(one_camera());
  processing.grid = centred_grid(8, 8, 8, 1);
  processing.recipe.solver = solver;
  return processing;
}

Run record_of(const Job& job, const std::string& worker) {
  Run run;
  run.id = job.run_id;
  run.job_id = job.id;
  run.inputs = job.inputs;
  run.processing = job.processing;
  run.program_version = job.program_version;
  run.solver = job.processing.recipe.solver;
  run.worker = worker;
  run.volume_path = "volumes/" + run.id + ".vtkhdf";
  run.finished_time_ns = job.created_time_ns + 1'000'000'000;
  return run;
}

double thread_cpu_s() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// A dispatcher in a thread that tells its CPU time at the end.
class Serving {
 public:
  Serving(Dispatcher& dispatcher, double& cpu_s)
      : thread_([&](std::stop_token stop) {
          (void)dispatcher.run(stop);
          cpu_s = thread_cpu_s();
        }) {}

 private:
  std::jthread thread_;
};

Result<> put_sets(Bus& bus, std::int64_t count) {
  Dealer dealer(bus, "capture", unique_name("bench"));
  if (auto ok = dealer.connect("inproc://dispatcher"); !ok) return ok;
  SetSender sender(std::move(dealer), {.max_unacked = 64, .resend_after = 10s});
  for (std::int64_t i = 0; i < count; ++i) {
    while (!sender.offer(small_set("bench", i))) sender.pump(10ms);
  }
  return sender.drain(kPatience);
}

Result<> wait_done(Client& client, std::int64_t jobs, std::stop_token stop) {
  std::int64_t before = -1;
  for (Stopwatch quiet; quiet.wall_s() < 60;) {
    const auto status = client.ask_for<Status>(GetStatus{}, kPatience);
    if (!status) return tl::unexpected(status.error());
    if (status->done == jobs) return {};
    if (stop.stop_requested()) return unavailable("bench", "it was stopped", "start it again");
    if (status->done != before) quiet = Stopwatch();
    before = status->done;
    std::this_thread::sleep_for(5ms);
  }
  return unavailable("bench", "no job was done for a minute", "see the log");
}

Result<> measure_order(const QueueOptions& o, std::stop_token stop, QueueMeasurement& out) {
  Bus bus;
  double storing_cpu_s = 0, cpu_s = 0;
  Submit order;
  order.captures = {"bench"};
  order.processing = processing_of("mlem");
  {
    auto dispatcher = Dispatcher::open(bus, {.data_dir = o.data_dir});
    if (!dispatcher) return tl::unexpected(dispatcher.error());
    const Serving serving(**dispatcher, storing_cpu_s);
    auto client = Client::connect(bus, "operator", unique_name("bench"), "inproc://dispatcher");
    if (!client) return tl::unexpected(client.error());
    if (auto ok = client->ask(PutRig{one_camera()}, kPatience); !ok) return tl::unexpected(ok.error());
    if (auto ok = put_sets(bus, o.jobs); !ok) return ok;
    const Stopwatch watch;
    const auto submitted = client->ask_for<Submitted>(order, kPatience);
    if (!submitted) return tl::unexpected(submitted.error());
    out.submit_s = watch.wall_s();
  }
  const Stopwatch opening;
  auto dispatcher = Dispatcher::open(bus, {.data_dir = o.data_dir});
  if (!dispatcher) return tl::unexpected(dispatcher.error());
  out.restart_s = opening.wall_s();
  {
    const Serving serving(**dispatcher, cpu_s);
    auto client = Client::connect(bus, "operator", unique_name("bench"), "inproc://dispatcher");
    if (!client) return tl::unexpected(client.error());
    const Stopwatch watch;
    std::vector<std::jthread> working;
    for (int i = 0; i < o.workers; ++i) {
      working.emplace_back([&, i](std::stop_token end) {
        Worker worker(bus, {.name = concat("bench-", i), .data_dir = o.data_dir},
                      [&](const JobContext& context) -> Result<Run> {
                        Run run = record_of(context.lease.job, context.worker);
                        std::ofstream(o.data_dir / staged_path(run.volume_path, context.lease.token));
                        return run;
                      });
        (void)worker.run(end);
      });
    }
    if (auto ok = wait_done(*client, o.jobs, stop); !ok) return ok;
    out.done_s = watch.wall_s();
  }
  out.job_wall_ms = 1e3 * out.done_s / static_cast<double>(o.jobs);
  out.job_cpu_ms = 1e3 * cpu_s / static_cast<double>(o.jobs);
  return {};
}

// Runs of a hundred captures, two solvers.
Result<> fill(Ledger& ledger, std::int64_t runs, std::stop_token stop) {
  constexpr std::int64_t kTogether = 1000;
  if (auto rig = ledger.put_rig(one_camera(), kStart_ns); !rig) return tl::unexpected(rig.error());
  for (std::int64_t first = 0; first < runs; first += kTogether) {
    if (stop.stop_requested()) return unavailable("bench", "it was stopped", "start it again");
    auto transaction = ledger.begin();
    if (!transaction) return tl::unexpected(transaction.error());
    for (std::int64_t i = first; i < std::min(first + kTogether, runs); ++i) {
      const std::string capture = concat("capture-", i * 100 / runs);
      const FrameSet set = small_set(capture, i);
      const std::int64_t now_ns = kStart_ns + i * 1'000'000;
      if (auto ok = ledger.add_set(set, {1, static_cast<std::uint64_t>(i) * 256, 256}, now_ns); !ok)
        return tl::unexpected(ok.error());
      Job job;
      job.inputs = {{capture, i}};
      job.processing = processing_of(i % 2 == 0 ? "mlem" : "sirt");
      job.created_time_ns = now_ns;
      job.run_id = run_id_of(job);
      const auto id = ledger.add_job(job, 512);
      if (!id) return tl::unexpected(id.error());
      const auto lease = ledger.lease(id->value(), {"bench", false, now_ns, 1000});
      if (!lease) return tl::unexpected(lease.error());
      const auto done = ledger.finish((*lease)->token, record_of((*lease)->job, "bench"), now_ns);
      if (!done) return tl::unexpected(done.error());
    }
    if (auto ok = transaction->commit(); !ok) return ok;
  }
  return {};
}

template <class Ask>
Result<double> slowest_ms(const Ask& ask) {
  double slowest = 0;
  for (int i = 0; i < 5; ++i) {
    const Stopwatch watch;
    if (const auto answer = ask(); !answer) return tl::unexpected(answer.error());
    slowest = std::max(slowest, 1e3 * watch.wall_s());
  }
  return slowest;
}

Result<> measure_questions(const QueueOptions& o, std::stop_token stop, QueueMeasurement& out) {
  const std::filesystem::path folder = o.data_dir / "large";
  auto ledger = Ledger::open(folder);
  if (!ledger) return tl::unexpected(ledger.error());
  if (auto ok = fill(*ledger, o.runs, std::move(stop)); !ok) return ok;
  auto reader = LedgerReader::open(folder);
  if (!reader) return tl::unexpected(reader.error());
  const auto asked = [&](const std::string& what, const auto& ask) -> Result<> {
    const auto ms = slowest_ms(ask);
    if (!ms) return tl::unexpected(ms.error());
    out.ask_ms[what] = *ms;
    return {};
  };
  const std::int64_t late_ns = kStart_ns + (o.runs - o.runs / 100) * 1'000'000;
  return asked("newest 1000", [&] { return reader->runs(); })
      .and_then(
          [&] { return asked("of a capture", [&] { return reader->runs({.capture = "capture-50"}); }); })
      .and_then([&] { return asked("of a solver", [&] { return reader->runs({.solver = "sirt"}); }); })
      .and_then([&] {
        return asked("of a rig", [&] { return reader->runs({.rig_id = fingerprint(one_camera())}); });
      })
      .and_then([&] { return asked("since a time", [&] { return reader->runs({.since_ns = late_ns}); }); })
      .and_then([&] {
        return asked("of a capture and solver",
                     [&] { return reader->runs({.capture = "capture-50", .solver = "sirt"}); });
      })
      .and_then([&] { return asked("none at all", [&] { return reader->runs({.solver = "no-such"}); }); })
      .and_then([&] { return asked("receipt", [&] { return reader->receipt("capture-50"); }); })
      .and_then([&] { return asked("status", [&] { return ledger->status(); }); });
}

}  // namespace

Result<QueueMeasurement> measure_queue(const QueueOptions& options, std::stop_token stop,
                                       const std::function<void(const std::string&)>& progress) {
  QueueMeasurement out;
  progress(concat("an order of ", options.jobs, " jobs"));
  if (auto ok = measure_order(options, stop, out); !ok) return tl::unexpected(ok.error());
  if (options.runs == 0) return out;
  progress(concat("a ledger of ", options.runs, " runs"));
  if (auto ok = measure_questions(options, std::move(stop), out); !ok) return tl::unexpected(ok.error());
  return out;
}

}  // namespace flamefield
