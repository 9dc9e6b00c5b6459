#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "calibrate/calibrate.h"
#include "tests/support/scratch.h"

namespace flamefield {
namespace {

// 13 stereo pairs of a 9x6 board with 25 mm squares, in Debian's package opencv-doc.
const std::filesystem::path kFolder = "/usr/share/doc/opencv-doc/examples/data";

std::vector<BoardView> stereo_pairs() {
  std::vector<BoardView> views;
  for (const char* side : {"left", "right"}) {
    for (int k = 1; k <= 14; ++k) {
      const std::string number = std::to_string(100 + k).substr(1);
      const std::filesystem::path file = kFolder / (side + number + ".jpg");
      if (!std::filesystem::exists(file)) continue;
      const cv::Mat read = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
      if (read.empty()) continue;
      Image image(read.cols, read.rows);
      cv::Mat target(read.rows, read.cols, CV_32F, image.pixels.data());
      read.convertTo(target, CV_32F);
      views.push_back({side, number, std::move(image)});
    }
  }
  return views;
}

// The same pairs by other programs: OpenCV's stereoCalibrate 0.215 px, 83.18 mm; mrcal 0.208 px, f 533.6 and
// 537.4 px, 83.17 mm.
TEST(RealImages, TheStereoPairsOfOpenCvGiveTheBaselineThatOtherProgramsFind) {
  const std::vector<BoardView> views = stereo_pairs();
  if (views.size() < 26) {
    GTEST_SKIP() << "no images left01.jpg ... right14.jpg in " << kFolder << ": install opencv-doc";
  }
  const BoardSpec board{9, 6, 25};
  const auto detections = detect(views, board);
  ASSERT_TRUE(detections);
  std::size_t found = 0;
  for (const Detection& d : *detections) {
    found += d.found();
    if (!d.found()) printf("%s %s %s\n", d.camera.c_str(), d.pose.c_str(), d.reason.c_str());
  }
  EXPECT_EQ(found, 26u);

  const auto report =
      calibrate(*detections, board, {.intrinsics = IntrinsicsMode::Free, .free_aspect = true});
  ASSERT_TRUE(report) << report.error().message;
  const Camera &left = report->rig.cameras[0], &right = report->rig.cameras[1];
  const double baseline_mm = (left.centre_mm() - right.centre_mm()).norm();
  std::printf(
      "13 pairs: rms %.4f px (%d of %d rejected), f %.1f/%.1f, %.1f/%.1f px, baseline %.2f mm, %.2f s\n",
      report->rms_px, report->rejected_corners, report->corners + report->rejected_corners, left.fx_px,
      left.fy_px, right.fx_px, right.fy_px, baseline_mm, report->seconds);
  EXPECT_LE(report->rms_px, 0.215);
  EXPECT_NEAR(baseline_mm, 83.17, 0.3);
  EXPECT_NEAR(left.fx_px, 533.6, 0.003 * 533.6);
  EXPECT_NEAR(right.fx_px, 537.4, 0.003 * 537.4);
}

// mrcal on the corners that we keep, with the same lens model and a flat board.
TEST(RealImages, MrcalFindsTheSameResidualOnTheSameCorners) {
  if (!std::filesystem::exists("/usr/bin/mrcal-calibrate-cameras")) GTEST_SKIP() << "mrcal is not installed";
  const std::vector<BoardView> views = stereo_pairs();
  if (views.size() < 26) GTEST_SKIP() << "no images in " << kFolder << ": install opencv-doc";
  const BoardSpec board{9, 6, 25};
  const auto detections = detect(views, board);
  ASSERT_TRUE(detections);
  const auto report = calibrate(
      *detections, board, {.intrinsics = IntrinsicsMode::Free, .free_aspect = true, .free_tangential = true});
  ASSERT_TRUE(report) << report.error().message;

  const Scratch scratch;
  std::ofstream corners(scratch / "corners.vnl");
  corners << "# filename x y weight\n" << std::setprecision(17);
  for (const ViewReport& view : report->views) {
    ASSERT_TRUE(view.is_used());
    for (std::size_t i = 0; i < view.corners_px.size(); ++i) {
      const Eigen::Vector2d& p = view.corners_px[i];
      corners << (kFolder / (view.camera + view.pose + ".jpg")).string() << ' ' << p.x() << ' ' << p.y()
              << (view.used[i] ? " 1\n" : " -1\n");
    }
  }
  corners.close();
  const std::string folder = scratch.path().string();
  const std::string command =
      "cd '" + folder +
      "' && mrcal-calibrate-cameras --corners-cache corners.vnl --corners-cache-has-weights --lensmodel "
      "LENSMODEL_OPENCV4 "
      "--focal 530 --object-spacing 0.025 --object-width-n 9 --object-height-n 6 --skip-outlier-rejection "
      "--skip-calobject-warp-solve --skip-regularization --outdir . '" +
      kFolder.string() + "/left[01]*.jpg' '" + kFolder.string() + "/right[01]*.jpg' > out 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << std::ifstream(scratch / "out").rdbuf();
  // It prints one decimal; its model file holds the whole solution.
  const std::string measure =
      "cd '" + folder +
      "' && /usr/bin/python3 -c \"import mrcal, numpy as np; "
      "o = mrcal.cameramodel('camera-0.cameramodel').optimization_inputs(); "
      "x = mrcal.optimizer_callback(**o)[1][:mrcal.num_measurements_boards(**o)].reshape(-1, 2); "
      "used = o['observations_board'][..., 2].ravel() > 0; "
      "print(np.sqrt(np.mean(np.sum(x[used] ** 2, axis=1))))\" > rms";
  ASSERT_EQ(std::system(measure.c_str()), 0);
  double theirs = 0;
  ASSERT_TRUE(std::ifstream(scratch / "rms") >> theirs);
  std::printf("mrcal %.4f px, ours %.4f px\n", theirs, report->rms_px);
  EXPECT_NEAR(report->rms_px, theirs, 0.02 * theirs);
}

}  // namespace
}  // namespace flamefield
