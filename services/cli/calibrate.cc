#include "calibrate/calibrate.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>

#include "services/calibration/flame_check.h"
#include "services/calibration/output.h"
#include "services/cli/board_images.h"
#include "services/cli/board_options.h"
#include "services/cli/calibration_output.h"
#include "services/cli/commands.h"
#include "services/cli/detection_cache.h"
#include "services/cli/options.h"
#include "services/cli/progress.h"
#include "services/store/file.h"
#include "services/store/projection_file.h"
#include "services/store/rig_file.h"

namespace flamefield {

namespace {

struct Options {
  std::vector<std::filesystem::path> images, projections;
  DomainOptions domain;
  BoardOptions board;
  std::string intrinsics = "prior", reference;
  double focal_px = 0;
  std::vector<double> reference_centre_mm = {0, 0, 0};
  double reference_azimuth_deg = 0;
  std::filesystem::path known, rig, out, report, cache, compare;
  std::vector<double> volume_mm = {60, 80};
  std::vector<std::string> free;
  bool board_bow = false, allow_loose = false, json = false;
};

std::vector<Detection> detect_all(const std::vector<BoardView>& views, const BoardSpec& board,
                                  const std::filesystem::path& cache_file, const Session& session) {
  session.check_stop();
  ProgressBar progress("detecting");
  DetectOptions detection;
  detection.progress = [&](std::size_t done) {
    progress.update(static_cast<double>(done), static_cast<double>(views.size()));
  };
  DetectionCache cache = DetectionCache::read(cache_file);
  auto detections = or_fail(cache.detect(views, board, detection));
  session.check_stop();
  if (!cache_file.empty()) or_fail(cache.write(cache_file));
  return detections;
}

CalibrationOptions calibration_of(const Options& options) {
  CalibrationOptions calibration;
  calibration.reference_pose = options.reference;
  const auto& c = options.reference_centre_mm;
  calibration.world_from_reference =
      upright_board({c[0], c[1], c[2]}, rad_of_deg(options.reference_azimuth_deg));
  calibration.intrinsics = options.intrinsics == "fixed"  ? IntrinsicsMode::Fixed
                           : options.intrinsics == "free" ? IntrinsicsMode::Free
                                                          : IntrinsicsMode::Prior;
  calibration.volume.diameter_mm = options.volume_mm[0];
  calibration.volume.height_mm = options.volume_mm[1];
  const auto is_free = [&](const char* name) {
    return std::ranges::find(options.free, name) != options.free.end();
  };
  calibration.free_aspect = is_free("aspect");
  calibration.free_tangential = is_free("tangential");
  calibration.free_k3 = is_free("k3");
  calibration.free_bow = options.board_bow;
  calibration.require_connected = !options.allow_loose;
  if (options.focal_px > 0) calibration.focal_px = options.focal_px;
  if (!options.known.empty()) calibration.known = or_fail(read_rig(options.known)).cameras;
  return calibration;
}

// What has changed since an earlier calibration.
std::optional<RigComparison> comparison_with(const std::filesystem::path& rig,
                                             const CalibrationReport& report) {
  if (rig.empty()) return std::nullopt;
  return or_fail_about(rig, compare_rigs(report.rig, or_fail(read_rig(rig)), report.volume));
}

void solve(const Options& options, const Session& session) {
  const BoardSpec board = board_of(options.board);
  if (!options.compare.empty()) (void)or_fail(read_rig(options.compare));  // before the work
  const CalibrationOptions calibration = calibration_of(options);
  or_fail(check_writable(options.out));
  if (!options.report.empty()) {
    std::error_code ignored;  // trying to write says it better
    std::filesystem::create_directories(options.report, ignored);
    or_fail(check_writable(options.report / "report.html"));
  }
  const std::vector<BoardView> views = read_board_views(options.images);
  const auto detections = detect_all(views, board, options.cache, session);
  const CalibrationReport report = or_fail(calibrate(detections, board, calibration));
  session.check_stop();
  const auto comparison = comparison_with(options.compare, report);
  or_fail(write_rig(options.out, report.rig));
  if (!options.report.empty())
    or_fail(write_calibration_report(options.report, report,
                                     {.board = board,
                                      .command_line = session.command_line(),
                                      .comparison = comparison,
                                      .compared_with = options.compare.string(),
                                      .views = views}));
  if (options.json) {
    std::cout << json_text(report);
  } else {
    print(report, options.out);
    if (comparison) print(*comparison, options.compare.string());
  }
}

// Ends the command with exit code 1 when a camera has moved.
void refuse_moved(const std::vector<std::string>& cameras, const std::string& why) {
  if (cameras.empty()) return;
  std::string names;
  for (const std::string& camera : cameras) names += (names.empty() ? "" : ", ") + camera;
  throw CommandFailure{ExitCode::Failed, concat("moved: ", names, " (", why, ") calibrate again")};
}

void check_by_flame(const Options& options, const Session& session) {
  const Rig rig = or_fail(read_rig(options.rig));
  if (options.domain.size.empty())
    throw CommandFailure{ExitCode::Usage,
                         "--size is missing (the flame has to be reconstructed) give it as for "
                         "'flamefield reconstruct'"};
  std::vector<Projections> sets;
  for (const auto& path : options.projections) sets.push_back(or_fail(read_projections(path, &rig)));
  const FlameCheck found =
      or_fail(check_by_flame(rig, options.domain.grid(), sets, {.stop = session.stop()}));
  if (options.json) {
    std::cout << json_text(found);
  } else {
    print(found);
  }
  refuse_moved(found.moved, "the flame's pictures do not fit what the other cameras foretell");
}

void check_ring(const Options& options, const Session& session) {
  if (!options.projections.empty()) return check_by_flame(options, session);
  if (options.images.empty() || options.board.square_mm == 0)
    throw CommandFailure{ExitCode::Usage,
                         "nothing to check with (neither pictures of a board nor of a flame) give "
                         "IMAGES and --square-mm, or --projections and --size"};
  const BoardSpec board = board_of(options.board);
  const Rig rig = or_fail(read_rig(options.rig));
  const auto detections = detect_all(read_board_views(options.images, &rig), board, options.cache, session);
  const CheckReport report = or_fail(check(rig, detections, board));
  if (options.json) {
    std::cout << json_text(report);
  } else {
    print(report);
  }
  refuse_moved(report.moved, "the board is not where the rig expects it");
}

// Returns IMAGES and --square-mm.
std::pair<CLI::Option*, CLI::Option*> add_board(CLI::App& command, Options& options,
                                                const std::string& what) {
  CLI::Option* images = command.add_option("IMAGES", options.images, what);
  CLI::Option* square = add_board_options(command, options.board);
  command.add_option("--cache", options.cache,
                     "File that keeps the corners found, so that no picture is searched twice");
  command.add_flag("--json", options.json, "Print the result as JSON");
  return {images, square};
}

}  // namespace

void add_calibrate(CLI::App& app, Session& session) {
  auto* calibrate_command = app.add_subcommand("calibrate", "Find where the cameras are and how they see");
  calibrate_command->require_subcommand(1);

  auto options = std::make_shared<Options>();
  auto* command =
      calibrate_command->add_subcommand("solve", "Calibrate the whole ring from pictures of a board");
  const auto [images, square] = add_board(
      *command, *options,
      "One folder a camera, named as it; equal file names show the same board pose. A folder of such "
      "folders or a recorded session (.nxs) will do");
  images->required();
  square->required();
  command->add_option("--intrinsics", options->intrinsics, "fixed, prior or free")
      ->check(CLI::IsMember({"fixed", "prior", "free"}))
      ->capture_default_str();
  command->add_option("--focal-px", options->focal_px, "Nominal focal length of every camera")
      ->check(CLI::PositiveNumber);
  command->add_option("--known", options->known, "Rig with known lenses, for --intrinsics fixed or prior");
  command
      ->add_option("--free", options->free,
                   "More of each lens to estimate than f, centre, k1, k2: aspect, tangential (p1 p2), k3")
      ->delimiter(',')
      ->check(CLI::IsMember({"aspect", "tangential", "k3"}));
  command->add_flag("--board-bow", options->board_bow, "Estimate how far the board is bent");
  command->add_flag("--allow-loose", options->allow_loose,
                    "Calibrate the cameras that hang together where others cannot be tied to them");
  command->add_option("--volume-mm", options->volume_mm, "Measuring volume: diameter,height of a cylinder")
      ->delimiter(',')
      ->expected(2)
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--reference", options->reference,
                      "Pose of the board on the burner. Default: the first");
  command->add_option("--reference-centre-mm", options->reference_centre_mm, "Where its middle is: X,Y,Z")
      ->delimiter(',')
      ->expected(3)
      ->capture_default_str();
  command->add_option("--reference-azimuth-deg", options->reference_azimuth_deg, "Where its face looks")
      ->capture_default_str();
  command->add_option("--out", options->out, "Rig to write: rig.yaml")->required();
  command->add_option("--compare", options->compare, "Earlier rig: name the cameras that have moved since");
  command->add_option("--report", options->report, "Folder for report.html and calibration.json");
  command->footer(
      "Example:\n  flamefield calibrate solve boards/* --board 9x6 --square-mm 25 --out rig.yaml");
  command->callback([options, &session] { session.choose([=, &session] { solve(*options, session); }); });

  add_calibrate_session(*calibrate_command, session);
  add_calibrate_history(*calibrate_command, session);

  auto check_options = std::make_shared<Options>();
  auto* check_command =
      calibrate_command->add_subcommand("check", "Has a camera moved? Exit code 1 when one has");
  check_command->add_option("--rig", check_options->rig, "The rig as it was")->required();
  add_board(*check_command, *check_options,
            "One picture a camera of the same board pose, named as it (cam00.png ...), or more poses as for "
            "solve. Three cameras that see the board are enough");
  check_command
      ->add_option("--projections", check_options->projections,
                   "Instead of a board: prepared pictures of a flame, one file a set. Shifts of 1 px or more "
                   "are named (eight simulated flames, 15 cameras; others stay within 0.1 px)")
      ->check(CLI::ExistingFile);
  add_domain(*check_command, check_options->domain, false);
  check_command->footer(
      "Examples:\n  flamefield calibrate check --rig rig.yaml today/cam*.png --board 9x6 --square-mm 25\n"
      "  flamefield calibrate check --rig cropped.yaml --projections p.nxs --size 52,55,52 --spacing-mm "
      "1.32");
  check_command->callback(
      [check_options, &session] { session.choose([=, &session] { check_ring(*check_options, session); }); });
}

}  // namespace flamefield
