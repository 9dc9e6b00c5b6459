#include "calibrate/calibrate.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>

#include "services/cli/board_images.h"
#include "services/cli/calibration_output.h"
#include "services/cli/commands.h"
#include "services/cli/detection_cache.h"
#include "services/cli/options.h"
#include "services/cli/progress.h"
#include "services/store/file.h"
#include "services/store/rig_file.h"

namespace flamefield {

namespace {

struct Options {
  std::vector<std::filesystem::path> images;
  std::string board = "9x6", board_type = "checkerboard", intrinsics = "prior", reference;
  double square_mm = 0;
  double focal_px = 0;
  std::vector<double> reference_centre_mm = {0, 0, 0};
  double reference_azimuth_deg = 0;
  std::filesystem::path known, rig, out, report, cache;
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

BoardSpec board_of(const Options& options) {
  const BoardSpec board = or_usage(board_from_text(options.board, options.square_mm));
  or_usage(validate(board));
  return board;
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

void solve(const Options& options, const Session& session) {
  const BoardSpec board = board_of(options);
  const CalibrationOptions calibration = calibration_of(options);
  or_fail(check_writable(options.out));
  if (!options.report.empty()) {
    std::error_code ignored;  // trying to write says it better
    std::filesystem::create_directories(options.report, ignored);
    or_fail(check_writable(options.report / "report.html"));
  }
  const auto detections = detect_all(read_board_views(options.images), board, options.cache, session);
  const CalibrationReport report = or_fail(calibrate(detections, board, calibration));
  session.check_stop();
  or_fail(write_rig(options.out, report.rig));
  if (!options.report.empty())
    or_fail(write_calibration_report(options.report, report, board, session.command_line()));
  if (options.json) {
    std::cout << json_text(report);
  } else {
    print(report, options.out);
  }
}

void check_ring(const Options& options, const Session& session) {
  const BoardSpec board = board_of(options);
  const Rig rig = or_fail(read_rig(options.rig));
  const auto detections = detect_all(read_board_views(options.images, &rig), board, options.cache, session);
  const CheckReport report = or_fail(check(rig, detections, board));
  if (options.json) {
    std::cout << json_text(report);
  } else {
    print(report);
  }
  if (report.moved.empty()) return;
  std::string moved;
  for (const std::string& camera : report.moved) moved += (moved.empty() ? "" : ", ") + camera;
  throw CommandFailure{
      ExitCode::Failed,
      concat("moved: ", moved, " (the board is not where the rig expects it) calibrate again")};
}

void add_board(CLI::App& command, Options& options, const std::string& what) {
  command.add_option("IMAGES", options.images, what)->required();
  command.add_option("--board", options.board, "Inner corners of the board")->capture_default_str();
  command.add_option("--square-mm", options.square_mm, "Side of a square")->required();
  command.add_option("--board-type", options.board_type, "Kind of board")
      ->check(CLI::IsMember({"checkerboard"}))
      ->capture_default_str();
  command.add_option("--cache", options.cache,
                     "File that keeps the corners found, so that no picture is searched twice");
  command.add_flag("--json", options.json, "Print the result as JSON");
}

}  // namespace

void add_calibrate(CLI::App& app, Session& session) {
  auto* calibrate_command = app.add_subcommand("calibrate", "Find where the cameras are and how they see");
  calibrate_command->require_subcommand(1);

  auto options = std::make_shared<Options>();
  auto* command =
      calibrate_command->add_subcommand("solve", "Calibrate the whole ring from pictures of a board");
  add_board(*command, *options,
            "One folder a camera, named as it; equal file names show the same board pose. A folder of such "
            "folders or a recorded session (.nxs) will do");
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
  command->add_option("--report", options->report, "Folder for report.html and calibration.json");
  command->footer(
      "Example:\n  flamefield calibrate solve boards/* --board 9x6 --square-mm 25 --out rig.yaml");
  command->callback([options, &session] { session.choose([=, &session] { solve(*options, session); }); });

  auto check_options = std::make_shared<Options>();
  auto* check_command =
      calibrate_command->add_subcommand("check", "Has a camera moved? Exit code 1 when one has");
  check_command->add_option("--rig", check_options->rig, "The rig as it was")->required();
  add_board(*check_command, *check_options,
            "One picture a camera of the same board pose, named as it (cam00.png ...), or more poses as for "
            "solve. Three cameras that see the board are enough");
  check_command->footer(
      "Example:\n  flamefield calibrate check --rig rig.yaml today/cam*.png --board 9x6 --square-mm 25");
  check_command->callback(
      [check_options, &session] { session.choose([=, &session] { check_ring(*check_options, session); }); });
}

}  // namespace flamefield
