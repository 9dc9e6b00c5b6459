#include "calibrate/calibrate.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "services/cli/board_images.h"
#include "services/cli/commands.h"
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
  std::filesystem::path known, rig, out, report;
  bool json = false;
};

std::vector<Detection> detect_all(const Options& options, const BoardSpec& board, const Session& session) {
  const std::vector<BoardView> views = read_board_views(options.images);
  session.check_stop();
  ProgressBar progress("detecting");
  DetectOptions detection;
  detection.progress = [&](std::size_t done) {
    progress.update(static_cast<double>(done), static_cast<double>(views.size()));
  };
  auto detections = or_fail(detect(views, board, detection));
  session.check_stop();
  return detections;
}

BoardSpec board_of(const Options& options) {
  const BoardSpec board = or_usage(board_from_text(options.board, options.square_mm));
  or_usage(validate_for_detection(board));
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
  if (options.focal_px > 0) calibration.focal_px = options.focal_px;
  if (!options.known.empty()) calibration.known = or_fail(read_rig(options.known)).cameras;
  return calibration;
}

nlohmann::json json_of(const VolumeError& error) {
  return {{"mean", error.mean_px}, {"worst", error.worst_px}, {"camera", error.worst_camera}};
}

nlohmann::json json_of(const CalibrationReport& report) {
  nlohmann::json cameras = nlohmann::json::array(), pairs = nlohmann::json::array();
  for (std::size_t i = 0; i < report.rig.cameras.size(); ++i) {
    const CameraQuality& q = report.rig.quality->cameras[i];
    cameras.push_back({{"name", report.rig.cameras[i].name},
                       {"images", q.images},
                       {"corners", q.corners},
                       {"rejected", q.rejected_corners},
                       {"rms_px", q.rms_px},
                       {"f_px", report.rig.cameras[i].fx_px},
                       {"sigma",
                        {{"f_px", q.focal_sigma_px},
                         {"position_mm", q.position_sigma_mm},
                         {"rotation_rad", q.rotation_sigma_rad}}}});
  }
  for (const SharedPoses& pair : report.pairs)
    pairs.push_back({{"a", pair.a}, {"b", pair.b}, {"poses", pair.poses}});
  nlohmann::json json = {{"rms_px", report.rms_px},
                         {"sigma_px", report.sigma_px},
                         {"corners", report.corners},
                         {"rejected", report.rejected_corners},
                         {"cameras", cameras},
                         {"pairs", pairs},
                         {"connected", report.connected},
                         {"unconnected", report.unconnected},
                         {"volume_error_px", json_of(report.expected_volume_error)},
                         {"converged", report.converged},
                         {"wall_s", report.seconds}};
  if (report.split_half) {
    json["split_half"] = {{"rotation_deg", report.split_half->rotation_rad * 180 / std::numbers::pi},
                          {"translation_mm", report.split_half->translation_mm}};
  } else {
    json["split_half"] = nullptr;
  }
  return json;
}

void print(const CalibrationReport& report, const std::filesystem::path& out) {
  std::printf("%-12s %7s %8s %9s %8s %9s\n", "camera", "images", "corners", "rejected", "RMS px", "f px");
  for (std::size_t i = 0; i < report.rig.cameras.size(); ++i) {
    const CameraQuality& q = report.rig.quality->cameras[i];
    std::printf("%-12s %7d %8d %9d %8.3f %9.1f\n", report.rig.cameras[i].name.c_str(), q.images, q.corners,
                q.rejected_corners, q.rms_px, report.rig.cameras[i].fx_px);
  }
  const VolumeError& error = report.expected_volume_error;
  std::printf("%s: RMS %.3f px, expected error in the volume %.3f px, worst %.3f px (%s): %s\n", out.c_str(),
              report.rms_px, error.mean_px, error.worst_px, error.worst_camera.c_str(),
              std::string(name_of(verdict_of(error))).c_str());
}

void solve(const Options& options, const Session& session) {
  const BoardSpec board = board_of(options);
  const CalibrationOptions calibration = calibration_of(options);
  or_fail(check_writable(options.out));
  const auto detections = detect_all(options, board, session);
  const CalibrationReport report = or_fail(calibrate(detections, board, calibration));
  session.check_stop();
  or_fail(write_rig(options.out, report.rig));
  const std::string json = json_of(report).dump(2) + "\n";
  if (!options.report.empty()) {
    std::error_code ignored;  // writing says it better
    std::filesystem::create_directories(options.report, ignored);
    or_fail(write_text_file(options.report / "calibration.json", json));
  }
  if (options.json) {
    std::cout << json;
  } else {
    print(report, options.out);
  }
}

// A fresh calibration with the old lenses, compared after the two worlds were laid over each other.
void check(const Options& options, const Session& session) {
  const BoardSpec board = board_of(options);
  const Rig rig = or_fail(read_rig(options.rig));
  CalibrationOptions calibration;
  calibration.intrinsics = IntrinsicsMode::Fixed;
  calibration.known = rig.cameras;
  calibration.split_half = false;
  const auto detections = detect_all(options, board, session);
  const CalibrationReport report = or_fail(calibrate(detections, board, calibration));
  Rig then;  // cameras that the new images show
  for (const Camera& camera : report.rig.cameras) {
    if (const auto i = rig.find(camera.name)) then.cameras.push_back(rig.cameras[*i]);
  }
  const VolumeError error = or_fail(volume_error_px(report.rig, then, calibration.volume, Alignment::Rigid));
  const Verdict verdict = verdict_of(error);
  if (options.json) {
    std::cout << nlohmann::json{{"volume_error_px", json_of(error)},
                                {"verdict", name_of(verdict)},
                                {"rms_px", report.rms_px},
                                {"cameras", then.cameras.size()}}
                     .dump(2)
              << '\n';
  } else {
    std::printf("%zu cameras: images of the volume moved by %.3f px, worst %.3f px (%s): %s\n",
                then.cameras.size(), error.mean_px, error.worst_px, error.worst_camera.c_str(),
                std::string(name_of(verdict)).c_str());
  }
  if (verdict == Verdict::Red) {
    throw CommandFailure{ExitCode::Failed,
                         concat("camera '", error.worst_camera, "' has moved (its images shifted by ",
                                error.worst_px, " px) calibrate again")};
  }
}

void add_board(CLI::App& command, Options& options) {
  command
      .add_option(
          "IMAGES", options.images,
          "One folder a camera, named as it; equal file names show the same board pose. A folder of such "
          "folders or a recorded session (.nxs) will do")
      ->required();
  command.add_option("--board", options.board, "Inner corners of the board")->capture_default_str();
  command.add_option("--square-mm", options.square_mm, "Side of a square")->required();
  command.add_option("--board-type", options.board_type, "Kind of board")
      ->check(CLI::IsMember({"checkerboard"}))
      ->capture_default_str();
  command.add_flag("--json", options.json, "Print the result as JSON");
}

}  // namespace

void add_calibrate(CLI::App& app, Session& session) {
  auto* calibrate_command = app.add_subcommand("calibrate", "Find where the cameras are and how they see");
  calibrate_command->require_subcommand(1);

  auto options = std::make_shared<Options>();
  auto* command =
      calibrate_command->add_subcommand("solve", "Calibrate the whole ring from pictures of a board");
  add_board(*command, *options);
  command->add_option("--intrinsics", options->intrinsics, "fixed, prior or free")
      ->check(CLI::IsMember({"fixed", "prior", "free"}))
      ->capture_default_str();
  command->add_option("--focal-px", options->focal_px, "Nominal focal length of every camera")
      ->check(CLI::PositiveNumber);
  command->add_option("--known", options->known, "Rig with known lenses, for --intrinsics fixed or prior");
  command->add_option("--reference", options->reference,
                      "Pose of the board on the burner. Default: the first");
  command->add_option("--reference-centre-mm", options->reference_centre_mm, "Where its middle is: X,Y,Z")
      ->delimiter(',')
      ->expected(3)
      ->capture_default_str();
  command->add_option("--reference-azimuth-deg", options->reference_azimuth_deg, "Where its face looks")
      ->capture_default_str();
  command->add_option("--out", options->out, "Rig to write: rig.yaml")->required();
  command->add_option("--report", options->report, "Folder for calibration.json");
  command->footer(
      "Example:\n  flamefield calibrate solve boards/* --board 9x6 --square-mm 25 --out rig.yaml");
  command->callback([options, &session] { session.choose([=, &session] { solve(*options, session); }); });

  auto check_options = std::make_shared<Options>();
  auto* check_command =
      calibrate_command->add_subcommand("check", "Has a camera moved? Exit code 1 when one has");
  check_command->add_option("--rig", check_options->rig, "The rig as it was")->required();
  add_board(*check_command, *check_options);
  check_command->footer(
      "Example:\n  flamefield calibrate check --rig rig.yaml boards/* --board 9x6 --square-mm 25");
  check_command->callback(
      [check_options, &session] { session.choose([=, &session] { check(*check_options, session); }); });
}

}  // namespace flamefield
