// bench scaling: how the projector's cost grows with volume, views and threads.
#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>
#include <thread>

#include "services/bench/projector_bench.h"
#include "services/cli/bench_commands.h"
#include "services/cli/bench_output.h"
#include "services/cli/options.h"

namespace flamefield {

namespace {

struct Options {
  std::vector<int> sizes = {40, 64, 128, 256, 512};
  std::vector<int> views = {8, 16, 24, 48};
  int middle = 128;  // the size at which views and threads vary
  double seconds = 0.5;
  double most_s = 60;
  double most_mib = 1536;
  bool json = false;
};

ProjectorCase cube(int size, int views) {
  return {concat(size), views, rad_of_deg(180.0 / views), size, size, size, size, size};
}

struct Row {
  ProjectorCase what;
  int threads = 0;
  std::string skipped;  // why; empty: measured
  ProjectorTiming timing;
  std::string engine;
};

class Scaling {
 public:
  Scaling(const Options& options, const Session& session)
      : options_(options), progress_("bench scaling", session) {}

  void measure(const ProjectorCase& what, int threads) {
    Row row{what, threads, why_not(what), {}, {}};
    progress_(concat(what.nx, "^3, ", what.views, " views, ", threads, " threads",
                     row.skipped.empty() ? "" : ": skipped, " + row.skipped));
    if (row.skipped.empty()) {
      const auto m = or_fail(measure_projector(what, ProjectorModel::Ray, {threads}, options_.seconds,
                                               [](const std::string&) {}));
      row.timing = m.timings.front();
      row.engine = m.engine;
      slowest_cpu_s_per_sample_ = (row.timing.forward_cpu_s + row.timing.adjoint_cpu_s) / what.samples();
    }
    rows_.push_back(std::move(row));
  }
  const std::vector<Row>& rows() const { return rows_; }

 private:
  std::string why_not(const ProjectorCase& what) const {
    const double mib = what.mib() * 1.2 + 3.0 * what.views * what.rows * what.cols * 4 / (1 << 20);
    if (mib > options_.most_mib) return concat("needs ", static_cast<int>(mib), " MiB");
    const double s = 3 * what.samples() * slowest_cpu_s_per_sample_;
    if (s > options_.most_s) return concat("would take ", static_cast<int>(s), " s");
    return {};
  }

  const Options& options_;
  BenchProgress progress_;
  std::vector<Row> rows_;
  double slowest_cpu_s_per_sample_ = 0;  // as last measured
};

nlohmann::json json_of(const std::vector<Row>& rows) {
  nlohmann::json list = nlohmann::json::array();
  for (const Row& r : rows) {
    nlohmann::json json = {{"size", r.what.nx}, {"views", r.what.views}, {"threads", r.threads}};
    if (!r.skipped.empty()) {
      json["skipped"] = r.skipped;
    } else {
      json.update({{"engine", r.engine},
                   {"samples", r.what.samples()},
                   {"forward_cpu_s", r.timing.forward_cpu_s},
                   {"forward_wall_s", r.timing.forward_wall_s},
                   {"adjoint_cpu_s", r.timing.adjoint_cpu_s},
                   {"adjoint_wall_s", r.timing.adjoint_wall_s}});
    }
    list.push_back(std::move(json));
  }
  return {{"peak_rss_mib", peak_rss_mib()}, {"rows", list}};
}

void run(const Options& options, const Session& session) {
  Scaling scaling(options, session);
  for (int size : options.sizes) scaling.measure(cube(size, 24), 1);
  for (int views : options.views) scaling.measure(cube(options.middle, views), 1);
  const int all = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  for (int threads = 2; threads <= all; threads = threads < all ? std::min(2 * threads, all) : all + 1)
    scaling.measure(cube(options.middle, 24), threads);
  if (options.json) {
    std::cout << json_of(scaling.rows()).dump(2) << '\n';
    return;
  }
  TextTable table({"volume (voxels)", "views", "threads", "forward (CPU-s)", "(wall s)", "adjoint (CPU-s)",
                   "(wall s)", "forward (samples/CPU-s)", "adjoint (samples/CPU-s)"});
  for (const Row& r : scaling.rows()) {
    std::vector<std::string> cells = {concat(r.what.nx, "^3"), concat(r.what.views), concat(r.threads)};
    if (!r.skipped.empty()) {
      cells.push_back("skipped: " + r.skipped);
    } else {
      for (double v :
           {r.timing.forward_cpu_s, r.timing.forward_wall_s, r.timing.adjoint_cpu_s, r.timing.adjoint_wall_s,
            r.what.samples() / r.timing.forward_cpu_s, r.what.samples() / r.timing.adjoint_cpu_s})
        cells.push_back(short_number(v));
    }
    table.add(std::move(cells));
  }
  std::cout << table.text() << "peak memory " << short_number(peak_rss_mib()) << " MiB\n";
}

}  // namespace

void add_bench_scaling(CLI::App& group, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command = group.add_subcommand("scaling", "The projector over volume, views and threads");
  command->add_option("--sizes", options->sizes, "Cubes of so many voxels a side, 24 views")
      ->delimiter(',')
      ->check(CLI::Range(4, 2048))
      ->capture_default_str();
  command->add_option("--views", options->views, "Numbers of views, at --middle")
      ->delimiter(',')
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_option("--middle", options->middle, "Side at which views and threads vary")
      ->check(CLI::Range(4, 2048))
      ->capture_default_str();
  command->add_option("--seconds", options->seconds, "Least time spent on each figure")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--time-limit-s", options->most_s, "Skip what would take longer")
      ->capture_default_str();
  command->add_option("--memory-mib", options->most_mib, "Skip what needs more")->capture_default_str();
  command->add_flag("--json", options->json, "Print the figures as JSON");
  command->footer("Example:\n  flamefield bench scaling --sizes 40,128,256");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
