#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>

#include "reconstruct/projector/column_kernels.h"
#include "reconstruct/solver.h"
#include "services/api/records_json.h"
#include "services/cli/commands.h"
#include "services/cli/on_ranks.h"
#include "services/cli/options.h"
#include "services/cli/progress.h"
#include "services/cli/ranks_record.h"
#include "services/cli/recipe_options.h"
#include "services/cli/together.h"
#include "services/config/recipe_file.h"
#include "services/store/file.h"
#include "services/store/projection_file.h"
#include "services/store/rig_file.h"
#include "services/store/volume_file.h"

namespace flamefield {

namespace {

constexpr double kPreviewEvery_s = 5;

struct Options {
  std::filesystem::path projections, rig, start, checkpoint, preview, out;
  DomainOptions domain;
  RecipeOptions recipe;
  std::uint64_t seed = 1;
  int threads = 0;
  double time_limit_s = 0;
  bool json = false;
};

nlohmann::ordered_json json_of(const Reconstruction& result) {
  return {{"solver", result.solver},
          {"iterations", result.iterations},
          {"residual", result.residual},
          {"residual_per_view", result.residual_per_view},
          {"wall_s", result.wall_s},
          {"voxel_updates", result.voxel_updates},
          {"offspring", result.offspring},
          {"peak_rss_mib", peak_rss_mib()},
          {"projector_engine", result.projector_engine},
          {"stop_reason", name_of(result.stop_reason)},
          {"notes", result.notes},
          {"history", json_of(result.history)}};
}

// Nothing that changes from run to run, so that equal work gives equal files.
Provenance provenance_of(const Options& options, const Recipe& recipe, const Rig& rig,
                         const Reconstruction& result) {
  Provenance facts = {{"program", concat("flamefield ", program_version())},
                      {"solver", result.solver},
                      {"recipe", toml_of(recipe)},
                      {"recipe_fingerprint", fingerprint(recipe)},
                      {"rig_fingerprint", fingerprint(rig)},
                      {"projections", options.projections.filename().string()},
                      {"projector_engine", result.projector_engine},
                      {"seed", concat(options.seed)},
                      {"iterations", concat(result.iterations)},
                      {"residual", concat(result.residual)},
                      {"stop_reason", std::string(name_of(result.stop_reason))}};
  if (!options.start.empty()) facts["start"] = options.start.filename().string();
  for (std::size_t i = 0; i < result.notes.size(); ++i) facts[concat("note_", i + 1)] = result.notes[i];
  return facts;
}

// The volume of --start. A .npy has no coordinates: it is taken to be on the domain.
Volume read_start(const std::filesystem::path& path, const Grid& grid) {
  Volume start = or_fail(read_volume(path));
  if (path.extension() == ".npy" && start.grid.nx == grid.nx && start.grid.ny == grid.ny &&
      start.grid.nz == grid.nz)
    start.grid = grid;
  return start;
}

// What an earlier, interrupted call left; empty when there is nothing.
std::string read_checkpoint(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<double> gather_rss(Ranks& ranks) {
  std::vector<double> out;
  for (const std::string& text : gather_texts(ranks, concat(peak_rss_mib()))) out.push_back(std::stod(text));
  return out;
}

struct Inputs {
  Grid grid;
  Recipe recipe;
  Rig rig;
  Projections projections;
  std::optional<Volume> start;
};

Inputs read_inputs(const Options& options) {
  Inputs in;
  in.grid = options.domain.grid();
  in.recipe = options.recipe.recipe();
  check_volume_output(options.out);
  const Rig whole_rig = or_fail(read_rig(options.rig));
  in.projections = or_fail(read_projections(options.projections, &whole_rig));
  in.rig = or_fail(rig_of_views(whole_rig, in.projections, options.rig));
  if (!options.start.empty()) in.start = read_start(options.start, in.grid);
  return in;
}

// FNV-1a, 64 bit.
std::string hash_of(std::span<const float> values) {
  std::uint64_t hash = 0xcbf29ce484222325;
  for (const std::byte b : std::as_bytes(values))
    hash = (hash ^ static_cast<std::uint64_t>(b)) * 0x100000001b3;
  return concat(hash);
}

// Slabs that were computed differently do not fit together.
void check_alike(Ranks& ranks, const Inputs& in) {
  check_alike(ranks, "program", concat(program_version()));
  check_alike(ranks, "kind of processor", vector_target());
  check_alike(ranks, "recipe", fingerprint(in.recipe));
  check_alike(ranks, "rig", fingerprint(in.rig));
  check_alike(ranks, "set of projections", hash_of(in.projections.values));
  check_alike(ranks, "start", in.start ? hash_of(in.start->values) : "none");
}

void run(const Options& options, const Session& session, Ranks* ranks) {
  const bool leads = !ranks || ranks->rank() == 0;  // shows, prints and writes
  const Inputs inputs = together(ranks, [&] { return read_inputs(options); });
  const auto& [grid, recipe, rig, projections, start] = inputs;
  if (ranks) check_alike(*ranks, inputs);
  if (!ranks) session.check_stop();

  std::optional<RanksRecord> record;
  if (ranks) record.emplace(*ranks, options.out, session.command_line(), session.stop());
  std::optional<ProgressBar> progress;
  if (leads) progress.emplace("reconstructing");
  SolveControl control{options.threads, options.time_limit_s, options.seed, session.stop(), {}};
  control.ranks = ranks;
  if (start) control.start = &*start;
  control.progress = [&](const SolverProgress& p) {
    if (record) record->at(p.iteration);
    if (progress)
      progress->update(p.iteration, p.max_iterations,
                       concat("iteration ", p.iteration, ", residual ", p.residual));
  };
  if (!options.preview.empty() && leads) {
    check_volume_output(options.preview);
    control.preview = [&](const Volume& best) { or_fail(write_volume(options.preview, best, {})); };
    control.preview_every_s = kPreviewEvery_s;
  }
  std::string state;
  if (!options.checkpoint.empty()) {
    state = read_checkpoint(options.checkpoint);
    control.resume = state;
    control.checkpoint = [&](std::string_view bytes) { or_fail(write_text_file(options.checkpoint, bytes)); };
  }
  const Reconstruction result =
      or_fail_about(options.projections, reconstruct(projections, rig, grid, recipe, control));
  const std::vector<double> rss_mib = ranks ? gather_rss(*ranks) : std::vector<double>();
  if (!leads) return;
  // Also when it was stopped: the best so far, marked by its stop_reason.
  or_fail(
      write_volume(options.out, result.volume, provenance_of(options, recipe, rig, result), result.sigma));
  if (record) record->end(result.stop_reason == StopReason::Cancelled ? "cancelled" : "done");
  const bool may_go_on =
      result.stop_reason == StopReason::Cancelled || result.stop_reason == StopReason::TimeLimit;
  if (!may_go_on && !options.checkpoint.empty()) std::filesystem::remove(options.checkpoint);
  for (const std::string& note : result.notes) std::cerr << "note: " << note << '\n';
  if (result.stop_reason == StopReason::Cancelled) {
    throw CommandFailure{ExitCode::Failed,
                         concat("stopped by request (after ", result.iterations, " iterations) ",
                                options.out.string(), " holds the best so far")};
  }
  if (options.json) {
    nlohmann::ordered_json json = json_of(result);
    if (ranks) json["peak_rss_mib_per_rank"] = rss_mib;
    std::cout << json.dump(2) << '\n';
    return;
  }
  std::cout << options.out.string() << ": " << result.solver << ", " << result.iterations << " iterations ("
            << name_of(result.stop_reason) << "), relative residual " << result.residual << ", "
            << result.wall_s << " s\n";
}

void add(CLI::App& app, Session& session, Ranks* ranks) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand("reconstruct", "Solve for the field behind a set of projections");
  command
      ->add_option("--projections", options->projections,
                   ".nxs, or .npy (views, rows, cols) in the rig's order")
      ->required();
  command->add_option("--rig", options->rig, "Cameras: rig.yaml")->required();
  add_domain(*command, options->domain, true);
  add_recipe(*command, options->recipe);
  command->add_option("--start", options->start,
                      "Volume to start from, on the same grid, e.g. of the pulse before");
  command->add_option("--preview", options->preview,
                      "ert: volume to write the best so far to, anew every 5 seconds");
  command->add_option("--checkpoint", options->checkpoint,
                      "ert: file to keep the evolution in, and to go on from if it is there");
  command->add_option("--seed", options->seed, "Of the stochastic solvers")->capture_default_str();
  command->add_option("--threads", options->threads, "0: all; the result does not depend on it")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command->add_option("--time-limit-s", options->time_limit_s, "Keeps the best so far; 0: none")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--out", options->out, "Volume to write: .vtkhdf .vti .npy .tif")->required();
  command->add_flag("--json", options->json, "Print the result as JSON");
  command->footer(
      "Example:\n  flamefield reconstruct --projections projections.nxs --rig rig.yaml --size 52,55,52 "
      "--spacing-mm 1 "
      "--solver mlem --set mlem.max_iterations=60 --out volume.vtkhdf --json");
  command->callback(
      [options, ranks, &session] { session.choose([=, &session] { run(*options, session, ranks); }); });
}

}  // namespace

void add_reconstruct(CLI::App& app, Session& session) {
  add(app, session, nullptr);
}

void add_reconstruct_on(Ranks& ranks, CLI::App& app, Session& session) {
  add(app, session, &ranks);
}

}  // namespace flamefield
