#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "calibrate/calibrate.h"

namespace flamefield {
namespace {

// 13 stereo pairs of a 9x6 board with 25 mm squares, in Debian's package opencv-doc.
const std::filesystem::path kFolder = "/usr/share/doc/opencv-doc/examples/data";

std::vector<BoardView> stereo_pairs() {
  std::vector<BoardView> views;
  for (const char* side : {"left", "right"}) {
    for (int k = 1; k <= 14; ++k) {
      const std::string number = std::to_string(100 + k).substr(1);
      const cv::Mat read = cv::imread((kFolder / (side + number + ".jpg")).string(), cv::IMREAD_GRAYSCALE);
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

}  // namespace
}  // namespace flamefield
