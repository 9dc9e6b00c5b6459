// Live reconstruction for a long time: simulated cameras, spool, ledger, worker, all in one process, every
// set reconstructed as it comes, each from the volume before. Options: soak_live --help.
// Exit code 0: every pulse became a volume, the 99th percentile of trigger -> committed volume is below the
// limit, and memory did not grow by more than a tenth after the first fifth.
#include <sys/resource.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <thread>

#include "proto/check.h"
#include "reconstruct/metrics.h"
#include "services/acquisition/operator.h"
#include "services/ledger/reader.h"
#include "services/log/log.h"
#include "services/serve/embedded.h"
#include "services/serve/live_planner.h"
#include "services/simulation/laboratory.h"
#include "services/store/volume_file.h"

using namespace flamefield;
using namespace std::chrono_literals;

namespace {

struct Options {
  double seconds = 60, rate_hz = 5, limit_ms = 500;
  int cameras = 15, workers = 1, threads = 2, iterations = 0;
  std::string solver, folder = "/tmp", first_address = "127.97.0.2";
};

template <class T>
T must(Result<T> result) {
  if (!result) {
    std::fprintf(stderr, "%s\n", result.error().message.c_str());
    std::exit(1);
  }
  if constexpr (!std::is_void_v<T>) return std::move(*result);
}

double rss_mib() {
  std::ifstream file("/proc/self/statm");
  double size = 0, resident = 0;
  file >> size >> resident;
  return resident * static_cast<double>(::sysconf(_SC_PAGESIZE)) / (1 << 20);
}

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1) + 0.5)];
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

struct Memory {
  double early_mib = 0, late_mib = 0, most_mib = 0;
};

Processing processing_of(const Options& o, const Laboratory& laboratory, PixelFormat format) {
  Processing processing;
  processing.grid = laboratory.film().truth(0).grid;
  processing.recipe = o.solver.empty() ? live_recipe() : Recipe{o.solver, {}};
  if (o.iterations > 0)
    processing.recipe.settings[processing.recipe.solver + ".max_iterations"] = std::int64_t{o.iterations};
  processing.recipe.settings["prepare.counts_per_unit"] =
      laboratory.film().electrons_per_unit() * laboratory.grey_levels_per_electron(format);
  return processing;
}

// Until every set of the capture is a volume or has failed, or nothing moves for a minute.
Receipt wait_for_volumes(const std::filesystem::path& folder, const std::string& capture) {
  auto reader = must(LedgerReader::open(folder));
  Receipt receipt;
  std::int64_t before = -1;
  for (auto since = std::chrono::steady_clock::now(); std::chrono::steady_clock::now() < since + 60s;) {
    receipt = must(reader.receipt(capture));
    if (receipt.pending == 0) break;
    if (receipt.volumes != before) since = std::chrono::steady_clock::now();
    before = receipt.volumes;
    std::this_thread::sleep_for(50ms);
  }
  return receipt;
}

bool report(const Options& o, const std::filesystem::path& folder, const std::string& capture,
            const Laboratory& laboratory, const Memory& memory) {
  const Receipt receipt = wait_for_volumes(folder, capture);
  auto reader = must(LedgerReader::open(folder));
  std::map<std::int64_t, SetRow> sets;
  for (const SetRow& set : must(reader.sets(capture))) sets[set.id.index] = set;
  std::vector<double> total_ms, set_ms, stored_ms, queue_ms, fetch_ms, prepare_ms, solve_ms, write_ms,
      pearson;
  std::int64_t warm = 0, iterations = 0;
  const auto runs = must(reader.runs({.capture = capture, .limit = 1'000'000}));
  for (const RunRow& row : runs) {
    const SetRow& set = sets.at(row.run.inputs.at(0).index);
    const auto ms_since_pulse = [&](std::int64_t time_ns) {
      return 1e-6 * static_cast<double>(time_ns - set.pulse_time_ns);
    };
    total_ms.push_back(ms_since_pulse(row.committed_time_ns));
    set_ms.push_back(ms_since_pulse(set.complete_time_ns));
    stored_ms.push_back(ms_since_pulse(set.stored_time_ns));
    queue_ms.push_back(1e3 * row.run.timings.queue_s);
    fetch_ms.push_back(1e3 * row.run.timings.fetch_s);
    prepare_ms.push_back(1e3 * row.run.timings.prepare_s);
    solve_ms.push_back(1e3 * row.run.timings.solve_s);
    write_ms.push_back(1e3 * row.run.timings.write_s);
    warm += !row.run.warm_start.empty();
    iterations += row.run.iterations;
    if (row.run.inputs[0].index % 20 != 19) continue;
    const Volume volume = must(read_volume(folder / row.run.volume_path));
    const auto frame = static_cast<int>(row.run.inputs[0].index % laboratory.film().frames());
    pearson.push_back(must(compare(laboratory.film().truth(frame), volume)).pearson);
  }
  const auto pulses = static_cast<std::int64_t>(o.seconds * o.rate_hz + 0.5);
  const std::int64_t lost = pulses - receipt.volumes;
  const double p99 = quantile(total_ms, 0.99);
  std::printf("cameras %d  rate_hz %g  pulses %ld  sets %ld  volumes %ld  failed %ld  lost %ld  receipt %s\n",
              o.cameras, o.rate_hz, static_cast<long>(pulses), static_cast<long>(receipt.sets),
              static_cast<long>(receipt.volumes), static_cast<long>(receipt.failed), static_cast<long>(lost),
              receipt.balances() ? "balances" : "DOES NOT BALANCE");
  std::printf("trigger_to_volume_ms p50 %.0f p90 %.0f p99 %.0f max %.0f\n", quantile(total_ms, 0.5),
              quantile(total_ms, 0.9), p99, quantile(total_ms, 1));
  std::printf("  since the trigger, p50/p99: set complete %.0f/%.0f, durable %.0f/%.0f\n",
              quantile(set_ms, 0.5), quantile(set_ms, 0.99), quantile(stored_ms, 0.5),
              quantile(stored_ms, 0.99));
  std::printf(
      "  each step, mean/p99: wait %.0f/%.0f, fetch %.0f/%.0f, prepare %.0f/%.0f, solve %.0f/%.0f, write "
      "%.0f/%.0f\n",
      mean(queue_ms), quantile(queue_ms, 0.99), mean(fetch_ms), quantile(fetch_ms, 0.99), mean(prepare_ms),
      quantile(prepare_ms, 0.99), mean(solve_ms), quantile(solve_ms, 0.99), mean(write_ms),
      quantile(write_ms, 0.99));
  std::printf("solver %s  iterations %.1f  warm_started %ld  pearson_mean %.4f\n",
              runs.empty() ? "" : runs.front().run.solver.c_str(),
              static_cast<double>(iterations) / static_cast<double>(std::max<std::size_t>(runs.size(), 1)),
              static_cast<long>(warm), mean(pearson));
  std::printf("rss_mib after a fifth %.0f, at the end %.0f, at most %.0f\n", memory.early_mib,
              memory.late_mib, memory.most_mib);
  return lost == 0 && receipt.balances() && p99 <= o.limit_ms && memory.late_mib <= 1.1 * memory.early_mib;
}

void add_options(CLI::App& app, Options& o) {
  app.option_defaults()->always_capture_default()->take_last();
  app.add_option("--seconds", o.seconds, "length of the capture");
  app.add_option("--rate-hz", o.rate_hz, "pulses per second");
  app.add_option("--limit-ms", o.limit_ms, "the 99th percentile of trigger to committed volume may be");
  app.add_option("--cameras", o.cameras, "simulated cameras");
  app.add_option("--workers", o.workers, "reconstruction workers");
  app.add_option("--threads", o.threads, "threads of each worker");
  app.add_option("--iterations", o.iterations, "of the solver; 0: as many as usual");
  app.add_option("--solver", o.solver, "of every set, as it is at the desk; default: the live recipe");
  app.add_option("--folder", o.folder, "where a data directory is made, and removed");
  app.add_option("--first-address", o.first_address, "of the simulated cameras");
}

int run(const Options& o, const std::filesystem::path& folder) {
  constexpr auto kFormat = PixelFormat::Mono12;
  LaboratoryOptions lab;
  lab.cameras = o.cameras;
  lab.rate_hz = o.rate_hz;
  lab.first_address = o.first_address;
  lab.film.grid = centred_grid(52, 55, 52, 1.32);
  lab.film.grid.origin_mm.y() += lab.height_mm;
  lab.film.frames = 10;  // shown again and again
  const auto laboratory = must(Laboratory::open(lab));
  must(laboratory->light_flame([](std::int64_t, std::int64_t) {}, {}));

  EmbeddedOptions embedded;
  embedded.data_dir = folder;
  embedded.http_port = -1;
  embedded.workers = o.workers;
  embedded.threads_per_worker = o.threads;
  embedded.acquisition.cameras = laboratory->cameras();
  embedded.acquisition.settings = laboratory->camera_settings(kFormat);
  embedded.acquisition.hooks = laboratory->hooks();
  Bus bus;
  const auto services = must(Embedded::start(bus, embedded));
  auto person = must(Operator::connect(bus, "operator", "inproc://acquisition", "inproc://dispatcher"));

  Processing processing = processing_of(o, *laboratory, kFormat);
  processing.rig_id =
      must(person.dispatcher().ask_for<RigStored>(PutRig{laboratory->true_rig()}, 10s)).rig_id;
  processing.dark_capture = must(person.capture({CaptureKind::Dark, 5}, [](auto, auto) {}, {})).id;
  must(person.dispatcher().ask_for<Accepted>(LivePlan{true, processing}, 10s));

  // The maps and the projector are made at the first set: not a part of what is measured.
  const auto first = must(person.capture({CaptureKind::Live, 3}, [](auto, auto) {}, {}));
  (void)wait_for_volumes(folder, first.id);

  Memory memory;
  const auto pulses = static_cast<std::int64_t>(o.seconds * o.rate_hz + 0.5);
  const auto state = must(person.capture({CaptureKind::Live, pulses},
                                         [&](std::int64_t done, std::int64_t total) {
                                           const double now_mib = rss_mib();
                                           if (done * 5 <= total) memory.early_mib = now_mib;
                                           memory.late_mib = now_mib;
                                           memory.most_mib = std::max(memory.most_mib, now_mib);
                                         },
                                         {}));
  return report(o, folder, state.id, *laboratory, memory) ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Reconstructs every set of a long simulated capture as it comes");
  Options options;
  add_options(app, options);
  CLI11_PARSE(app, argc, argv);
  set_log_level(LogLevel::Error);
  std::string folder = options.folder + "/flamefield-live-XXXXXX";
  if (!::mkdtemp(folder.data())) return 2;
  const int result = run(options, folder);
  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);
  return result;
}
