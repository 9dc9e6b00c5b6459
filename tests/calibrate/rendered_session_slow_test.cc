#include <gtest/gtest.h>

#include <cstdio>
#include <ctime>

#include "acquire/simulator/board_scene.h"
#include "calibrate/calibrate.h"
#include "tests/calibrate/synthetic.h"

namespace flamefield {
namespace {

// From pictures to rig: 15 cameras, 24 poses, 8 bits, shot and read noise, blur, shading, lens distortion.
TEST(RenderedSession, GivesTheTrueRigWithinATenthOfAPixel) {
  const std::uint64_t seed = 2;
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
  ASSERT_TRUE(detections);

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
    ASSERT_TRUE(expected) << detection.camera << ' ' << detection.pose << ": found what cannot be seen";
    for (std::size_t i = 0; i < expected->size(); ++i, ++corners) {
      sum += ((*expected)[i] - detection.corners_px[i]).squaredNorm();
    }
  }
  const double detection_rms_px = std::sqrt(sum / static_cast<double>(corners));
  EXPECT_GE(static_cast<double>(found), 0.95 * static_cast<double>(visible));
  EXPECT_LT(detection_rms_px, 0.08);

  const auto report = calibrate(*detections, scene.board, {.world_from_reference = poses[0]});
  ASSERT_TRUE(report) << report.error().message;
  const auto error = volume_error_px(report->rig, truth, {});
  ASSERT_TRUE(error);
  std::printf("%zu images: detection %.1f CPU-s, corner error %.4f px RMS (%zu corners); solve %.2f s\n",
              views.size(), detect_s, detection_rms_px, corners, report->seconds);
  std::printf("rms %.4f px, volume error %.4f px, worst %.4f px (%s), expected %.4f px\n", report->rms_px,
              error->mean_px, error->worst_px, error->worst_camera.c_str(),
              report->expected_volume_error.mean_px);
  EXPECT_LT(error->mean_px, 0.1);
  EXPECT_LT(error->worst_px, 0.2);
}

}  // namespace
}  // namespace flamefield
