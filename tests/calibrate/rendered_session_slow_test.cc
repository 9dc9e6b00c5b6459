#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstdio>
#include <ctime>
#include <random>

#include "acquire/simulator/board_scene.h"
#include "calibrate/calibrate.h"
#include "tests/calibrate/synthetic.h"

namespace flamefield {
namespace {

// From pictures to rig: 15 cameras, 24 poses, 8 bits, shot and read noise, blur, shading, lens distortion.
// Returns the foreseen and the true error in the measuring volume.
std::pair<double, double> expect_true_rig(std::uint64_t seed) {
  SCOPED_TRACE(seed);
  const Rig truth = ring_with_tolerances({.seed = seed});
  const std::vector<Rigid3> poses = board_poses({.count = 24, .seed = seed});
  const BoardScene scene;
  std::vector<BoardView> views;
  for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
    for (std::size_t k = 0; k < poses.size(); ++k) {
      Image image = render_board(truth.cameras[c], poses[k], scene);
      views.push_back({truth.cameras[c].name, pose_name(k),
                       with_noise(std::move(image), scene.full_scale_electrons, 100 * c + k)});
    }
  }
  const std::clock_t start = std::clock();
  const auto detections = detect(views, scene.board);
  const double detect_s = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  EXPECT_TRUE(detections);
  if (!detections) return {};

  double sum = 0;
  std::size_t corners = 0, visible = 0, found = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const Camera& camera = truth.cameras[v / poses.size()];
    const auto expected = true_corners(camera, poses[v % poses.size()], scene.board, 90);
    const Detection& detection = (*detections)[v];
    if (true_corners(camera, poses[v % poses.size()], scene.board, 55)) {
      ++visible;
      found += detection.found();
    }
    if (!detection.found()) continue;
    EXPECT_TRUE(expected) << detection.camera << ' ' << detection.pose << ": found what cannot be seen";
    if (!expected) return {};
    for (std::size_t i = 0; i < expected->size(); ++i, ++corners) {
      sum += ((*expected)[i] - detection.corners_px[i]).squaredNorm();
    }
  }
  const double detection_rms_px = std::sqrt(sum / static_cast<double>(corners));
  EXPECT_GE(static_cast<double>(found), 0.95 * static_cast<double>(visible));
  EXPECT_LT(detection_rms_px, 0.08);

  const auto report = calibrate(*detections, scene.board, {.world_from_reference = poses[0]});
  EXPECT_TRUE(report) << report.error().message;
  if (!report) return {};
  const auto error = volume_error_px(report->rig, truth, {});
  EXPECT_TRUE(error);
  std::printf("%zu images: detection %.1f CPU-s, corner error %.4f px RMS (%zu corners); solve %.2f s\n",
              views.size(), detect_s, detection_rms_px, corners, report->seconds);
  std::printf("rms %.4f px, volume error %.4f px, worst %.4f px (%s), expected %.4f px\n", report->rms_px,
              error->mean_px, error->worst_px, error->worst_camera.c_str(),
              report->expected_volume_error.mean_px);
  const auto aligned = volume_error_px(report->rig, truth, {}, Alignment::Rigid);
  EXPECT_TRUE(aligned);
  std::printf("clustering %.2f; without the world frame's share %.4f px, worst %.4f px\n", report->clustering,
              aligned->mean_px, aligned->worst_px);
  EXPECT_LT(error->mean_px, 0.1);
  EXPECT_LT(error->worst_px, 0.2);
  return {report->expected_volume_error.mean_px, error->mean_px};
}

TEST(RenderedSession, GivesTheTrueRigWithinATenthOfAPixelAndForeseesItsError) {
  double foreseen = 0, true_error = 0;  // squares: one session's error is one draw
  for (std::uint64_t seed : {2, 3, 4}) {
    const auto [of_session, truth] = expect_true_rig(seed);
    foreseen += of_session * of_session;
    true_error += truth * truth;
  }
  const double honesty = std::sqrt(foreseen / true_error);
  std::printf("foreseen over true error %.2f\n", honesty);
  EXPECT_GT(honesty, 0.7);
  EXPECT_LT(honesty, 1.4);
}

// Boards in random places up to 60 degrees off, sharp and blurred.
TEST(RenderedBoards, AreFoundUpToSixtyDegreesWithinEightHundredthsOfAPixel) {
  for (double blur_px : {0.4, 1.5}) {
    std::mt19937_64 engine(9);
    std::uniform_real_distribution<double> uniform(-1, 1);
    const Camera camera = ring_with_tolerances({.cameras = 1}).cameras[0];
    BoardScene scene;
    scene.defocus_sigma_px = blur_px;
    int shown = 0, found = 0, corners = 0;
    double sum = 0, worst = 0;
    while (shown < 120) {
      const Rigid3 roll{Eigen::AngleAxisd(0.3 * uniform(engine), Eigen::Vector3d::UnitZ()).toRotationMatrix(),
                        Eigen::Vector3d::Zero()};
      const Rigid3 tilt{Eigen::AngleAxisd(0.4 * uniform(engine), Eigen::Vector3d::UnitX()).toRotationMatrix(),
                        Eigen::Vector3d::Zero()};
      const Rigid3 pose =
          upright_board({20 * uniform(engine), 40 + 20 * uniform(engine), 20 * uniform(engine)},
                        1.05 * uniform(engine)) *
          tilt * roll;
      const auto truth = true_corners(camera, pose, scene.board, 60);
      // The outer squares have to be in the picture too.
      if (!truth || !true_corners(camera, pose, {11, 8, scene.board.square_mm}, 60)) continue;
      ++shown;
      Image image = with_noise(render_board(camera, pose, scene), scene.full_scale_electrons,
                               900 + static_cast<std::uint64_t>(shown));
      const Detection detection = detect_board({"cam00", "pose", std::move(image)}, scene.board);
      if (!detection.found()) continue;
      ++found;
      double of_view = 0;
      for (std::size_t i = 0; i < truth->size(); ++i, ++corners)
        of_view += ((*truth)[i] - detection.corners_px[i]).squaredNorm();
      sum += of_view;
      worst = std::max(worst, std::sqrt(of_view / static_cast<double>(truth->size())));
    }
    const double rms_px = std::sqrt(sum / corners);
    std::printf("blur %.1f px: %d of %d found, corners %.4f px RMS, worst view %.4f px\n", blur_px, found,
                shown, rms_px, worst);
    EXPECT_GE(found, 0.95 * shown);
    EXPECT_LE(rms_px, 0.08);
  }
}

}  // namespace
}  // namespace flamefield
