#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "services/cli/options.h"
#include "services/cli/plan.h"
#include "services/cli/progress.h"
#include "services/cli/recipe_options.h"
#include "services/ledger/query.h"
#include "services/plan/plan.h"

namespace flamefield {

namespace {

struct Options {
  Campaign campaign;
  Cluster cluster;
  DomainOptions domain;
  RecipeOptions recipe;
  std::vector<int> frame = {656, 494}, image;
  double memory_gib = 64, network_gbit_s = 1, dispatch_ms = 1.3;
  std::filesystem::path data;
  std::optional<double> set_s, set_mib;
  bool mpi = false, json = false;
};

// Of a whole solve, spread over its voxels.
Rates rates_of_solve(const Campaign& campaign, double seconds, double mib, std::string source) {
  Rates out;
  out.source = std::move(source);
  out.voxel_set_up_s = seconds / campaign.voxels();
  out.voxel_bytes = mib * 1048576 / campaign.voxels();
  return out;
}

// What was recorded of the same solver and grid; none: nothing.
std::optional<Rates> recorded_rates(const Options& options, const Campaign& campaign,
                                    const std::string& solver) {
  if (options.data.empty()) return std::nullopt;
  LedgerQuery ledger = or_fail(LedgerQuery::open(options.data));
  const PastWork past = or_fail(ledger.past_work(solver, campaign.grid));
  if (past.runs == 0) return std::nullopt;
  return rates_of_solve(
      campaign, past.seconds, past.peak_rss_mib,
      concat(past.runs, " runs in ", options.data.string(), ", as fast as their workers were then"));
}

Rates rates_for(const Options& options, const Campaign& campaign, const Session& session) {
  const Recipe recipe = options.recipe.recipe();
  if (options.set_s && options.set_mib)
    return rates_of_solve(campaign, *options.set_s, *options.set_mib, "given");
  if (!options.mpi)
    if (const auto recorded = recorded_rates(options, campaign, recipe.solver)) return *recorded;
  ProgressBar progress("measuring");
  int step = 0;
  return or_usage(measure_rates(recipe, campaign.views, session.stop(),
                                [&](const std::string& what) { progress.update(step++, 2, what); }));
}

std::string time_text(double seconds) {
  if (seconds < 1) return fmt::format("{:.3g} s", seconds);
  if (seconds < 120) return fmt::format("{:.1f} s", seconds);
  if (seconds < 7200) return fmt::format("{:.1f} min", seconds / 60);
  return seconds < 172800 ? fmt::format("{:.1f} h", seconds / 3600)
                          : fmt::format("{:.1f} d", seconds / 86400);
}

std::string bytes_text(double bytes) {
  if (bytes < 1e6) return fmt::format("{:.3g} kB", bytes / 1e3);
  if (bytes < 1e9) return fmt::format("{:.3g} MB", bytes / 1e6);
  return bytes < 1e12 ? fmt::format("{:.3g} GB", bytes / 1e9) : fmt::format("{:.3g} TB", bytes / 1e12);
}

std::string text_of(const Options& o, const Campaign& c, const Rates& rates, const Estimate& e) {
  const std::string unit = o.mpi ? "ranks" : "workers";
  std::string out = fmt::format("rates        {}\n", rates.source);
  out +=
      fmt::format("one set      {} on {}, {:.0f} MiB {}; {} of frames in, {} of volume out\n",
                  time_text(e.set_s), o.mpi ? "all ranks" : "one worker", e.set_mib,
                  o.mpi ? "a rank" : "a worker", bytes_text(c.frame_bytes()), bytes_text(c.volume_bytes()));
  out += fmt::format(
      "cluster      {} nodes x {} cores, {:.0f} GiB: {} {} of {} threads, {} a node, {:.1f} GiB of it\n",
      o.cluster.nodes, o.cluster.cores, o.memory_gib, e.workers, unit, o.cluster.threads, e.per_node,
      e.per_node * e.set_mib / 1024);
  if (o.mpi)
    out += fmt::format("iteration    {}, of which {} for {} through each rank's network\n",
                       time_text(e.iteration_s), time_text(e.exchange_s), bytes_text(e.exchange_bytes));
  out += fmt::format("campaign     {:.0f} sets: {}; {} in, {} out\n", c.sets, time_text(e.wall_s),
                     bytes_text(e.bytes_in), bytes_text(e.bytes_out));
  for (const Stage& stage : e.stages)
    out += fmt::format("  {:<32} {}\n", stage.name, time_text(stage.seconds));
  out += fmt::format("bottleneck   {}\n", e.bottleneck);
  for (const std::string& problem : e.problems) out += fmt::format("does not fit {}\n", problem);
  return out;
}

nlohmann::ordered_json json_of(const Campaign& c, const Rates& rates, const Estimate& e) {
  nlohmann::ordered_json stages;
  for (const Stage& stage : e.stages) stages[stage.name] = stage.seconds;
  return {{"rates", rates.source},
          {"voxel_iteration_s", rates.voxel_iteration_s},
          {"voxel_bytes", rates.voxel_bytes},
          {"pixel_bytes", rates.pixel_bytes},
          {"sets", c.sets},
          {"iterations", c.iterations},
          {"set_s", e.set_s},
          {"set_mib", e.set_mib},
          {"workers", e.workers},
          {"workers_per_node", e.per_node},
          {"iteration_s", e.iteration_s},
          {"exchange_s", e.exchange_s},
          {"exchange_bytes", e.exchange_bytes},
          {"bytes_in", e.bytes_in},
          {"bytes_out", e.bytes_out},
          {"stages_s", stages},
          {"wall_s", e.wall_s},
          {"bottleneck", e.bottleneck},
          {"fits", e.problems.empty()},
          {"problems", e.problems}};
}

void run(const Options& options, const Session& session) {
  Campaign campaign = options.campaign;
  campaign.grid = options.domain.grid();
  campaign.frame_width_px = options.frame[0], campaign.frame_height_px = options.frame[1];
  if (!options.image.empty())
    campaign.image_width_px = options.image[0], campaign.image_height_px = options.image[1];
  campaign.iterations = iterations_of(options.recipe.recipe()).value_or(0);
  Cluster cluster = options.cluster;
  cluster.memory_mib = 1024 * options.memory_gib;
  cluster.network_bytes_per_s = options.network_gbit_s * 1e9 / 8;
  if (options.set_s.has_value() != options.set_mib.has_value()) {
    throw CommandFailure{ExitCode::Usage,
                         "only one of --set-s and --set-mib (both are needed to plan) give the other"};
  }
  const Rates rates = rates_for(options, campaign, session);
  session.check_stop();
  const Estimate estimate = options.mpi ? plan_ranks(campaign, cluster, rates)
                                        : plan_sets(campaign, cluster, rates, options.dispatch_ms / 1000);
  if (options.json) {
    std::cout << json_of(campaign, rates, estimate).dump(2) << '\n';
    return;
  }
  std::cout << text_of(options, campaign, rates, estimate);
}

}  // namespace

void add_plan(CLI::App& app, Session& session) {
  auto o = std::make_shared<Options>();
  auto* command =
      app.add_subcommand("plan", "Memory, time and traffic of a campaign on a cluster, before it");
  command->add_option("--sets", o->campaign.sets, "Frame sets to reconstruct")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--cameras", o->campaign.views, "Views of a set")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  command->add_option("--frame", o->frame, "Width and height of a camera's frame, px")
      ->delimiter(',')
      ->expected(2)
      ->capture_default_str();
  command->add_option("--bytes-per-pixel", o->campaign.bytes_per_pixel, "Of a frame")
      ->check(CLI::Range(1, 2))
      ->capture_default_str();
  command->add_option("--image", o->image, "Width and height as reconstructed, px; default: the grid's")
      ->delimiter(',')
      ->expected(2);
  add_domain(*command, o->domain, true);
  add_recipe(*command, o->recipe);
  const auto whole = CLI::Range(1, 1000000);
  command->add_option("--nodes", o->cluster.nodes, "Machines")->check(whole)->capture_default_str();
  command->add_option("--cores", o->cluster.cores, "Of a machine")->check(whole)->capture_default_str();
  command->add_option("--threads", o->cluster.threads, "Of a worker, or of a rank")
      ->check(whole)
      ->capture_default_str();
  command
      ->add_option("--efficiency", o->cluster.efficiency,
                   "Of busy cores that share memory, against one alone")
      ->check(CLI::Range(0.01, 1.0))
      ->capture_default_str();
  command->add_option("--memory-gib", o->memory_gib, "Of a machine")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--network-gbit-s", o->network_gbit_s, "Of a machine")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command
      ->add_option("--dispatch-ms", o->dispatch_ms,
                   "Dispatcher's time for a set, see 'flamefield bench queue'")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--data", o->data, "Ledger whose runs of this solver and grid say what a set takes");
  command->add_option("--set-s", o->set_s, "A set takes so long on one core, instead of measuring")
      ->check(CLI::PositiveNumber);
  command->add_option("--set-mib", o->set_mib, "A set needs so much memory, instead of measuring")
      ->check(CLI::PositiveNumber);
  command->add_flag("--mpi", o->mpi, "Each set on all nodes at once (flamefield-mpi)");
  command->add_flag("--json", o->json, "Print the figures as JSON");
  command->footer(
      "Example:\n  flamefield plan --sets 10000 --cameras 15 --size 52,55,52 --nodes 4 --cores 32 "
      "--memory-gib 128 "
      "--network-gbit-s 10\n  flamefield plan --mpi --cameras 24 --size 1024,1024,1024 --nodes 16 --cores 32 "
      "--threads 32");
  command->callback([o, &session] { session.choose([=, &session] { run(*o, session); }); });
}

}  // namespace flamefield
