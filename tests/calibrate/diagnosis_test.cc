#include "calibrate/diagnosis.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

#include "acquire/simulator/board_scene.h"
#include "calibrate/detect.h"
#include "calibrate/larger_board.h"
#include "tests/calibrate/synthetic.h"

namespace flamefield {
namespace {

using testing::HasSubstr;

const Camera kCamera = ring_with_tolerances({.cameras = 1}).cameras[0];

// 8 bits of a board; `exposure` 1 is a good one.
Image picture(const Rigid3& pose, double defocus_sigma_px = 0.7, double exposure = 1,
              const BoardSpec& board = {}) {
  BoardScene scene;
  scene.board = board;
  scene.defocus_sigma_px = defocus_sigma_px;
  Image image = render_board(kCamera, pose, scene);
  for (float& value : image.pixels) value *= static_cast<float>(exposure);
  return with_noise(std::move(image), scene.full_scale_electrons, 5);
}
Rigid3 facing(double obliquity_deg, const Eigen::Vector3d& centre_mm = {0, 40, 0}) {
  return upright_board(centre_mm, obliquity_deg * std::numbers::pi / 180);
}
std::string reason(const Image& image, const BoardSpec& board = {}) {
  const Detection detection = detect_board({"cam00", "pose", image}, board);
  return detection.found() ? "found" : detection.reason;
}

TEST(Diagnosis, ABoardThatIsTurnedTooFarIsTooOblique) {
  for (double angle : {74.0, 78.0, -76.0}) {
    EXPECT_THAT(reason(picture(facing(angle))), HasSubstr("too oblique")) << angle;
  }
}

TEST(Diagnosis, ABoardOutOfFocusIsBlurred) {
  for (double sigma : {6.0, 8.0})
    EXPECT_THAT(reason(picture(facing(10), sigma)), HasSubstr("blurred")) << sigma;
}

TEST(Diagnosis, ABoardThatLeavesTheImageIsCutOffAtThatEdge) {
  EXPECT_THAT(reason(picture(facing(0, {0, 40, 130}))), HasSubstr("cut off at the left edge"));
  EXPECT_THAT(reason(picture(facing(0, {0, 40, -130}))), HasSubstr("cut off at the right edge"));
  EXPECT_THAT(reason(picture(facing(0, {0, 150, 0}))), HasSubstr("cut off at the upper edge"));
}

TEST(Diagnosis, AnUnderexposedBoardIsTooDark) {
  EXPECT_THAT(reason(picture(facing(10), 0.7, 0.002)), HasSubstr("too dark"));
}

TEST(Diagnosis, ASaturatedBoardIsOverexposed) {
  EXPECT_THAT(reason(picture(facing(10), 0.7, 40)), HasSubstr("overexposed"));
}

TEST(Diagnosis, SaysWhichBoardItSaw) {
  const Image image = picture(facing(10), 0.7, 1, {9, 6, 12});
  EXPECT_THAT(reason(image, {11, 8, 12}), HasSubstr("looked for 11x8 inner corners, found 9x6"));
  EXPECT_THAT(reason(image, {8, 7, 12}), HasSubstr("another board: looked for 8x7 inner corners, found 9x6"));
}

TEST(Diagnosis, APartOfALargerBoardIsNotTakenForTheBoard) {
  const Image image = picture(facing(0), 0.7, 1, {9, 6, 12});
  EXPECT_EQ(reason(image, {9, 6, 12}), "found");
  EXPECT_THAT(reason(image, {8, 6, 12}), HasSubstr("looked for 8x6 inner corners, found "));
}

TEST(Diagnosis, NoSmallerSizeIsFoundInALargerBoard) {
  for (const double angle : {0.0, 20.0}) {
    const Image image = picture(facing(angle), 0.7, 1, {9, 6, 12});
    for (const auto& [cols, rows] : {std::array{8, 5}, std::array{7, 5}, std::array{7, 4}, std::array{5, 4}})
      EXPECT_NE(reason(image, {cols, rows, 12}), "found") << cols << 'x' << rows << " at " << angle;
  }
}

// Which part of it was found, nobody could tell.
TEST(LargerBoard, IsNamedWhereverThePartLiesInIt) {
  const BoardSpec board{9, 6, 12};
  for (double angle : {0.0, 25.0, -50.0}) {
    const Image image = picture(facing(angle), 0.7, 1, board);
    cv::Mat bytes;
    cv::Mat(image.height_px, image.width_px, CV_32F, const_cast<float*>(image.pixels.data()))
        .convertTo(bytes, CV_8U);
    const auto corners = *true_corners(kCamera, facing(angle), board, 80);
    const auto part = [&](int left, int top, int cols, int rows) {
      std::vector<cv::Point2f> points;
      for (int row = top; row < top + rows; ++row) {
        for (int col = left; col < left + cols; ++col) {
          const Eigen::Vector2d& p = corners[static_cast<std::size_t>(row * board.cols + col)];
          points.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
        }
      }
      return larger_board(bytes, points, {cols, rows, board.square_mm});
    };
    EXPECT_FALSE(part(0, 0, 9, 6)) << angle;
    for (const auto& [left, top, cols, rows] :
         {std::array{0, 0, 8, 6}, std::array{1, 1, 7, 4}, std::array{0, 2, 9, 4}, std::array{2, 0, 5, 4}}) {
      const auto found = part(left, top, cols, rows);
      ASSERT_TRUE(found) << angle << ": " << cols << 'x' << rows;
      EXPECT_EQ(*found, cv::Size(9, 6)) << angle << ": " << cols << 'x' << rows;
    }
  }
}

TEST(Diagnosis, AnEmptyRoomIsNoBoard) {
  EXPECT_THAT(reason(picture(facing(180))), HasSubstr("no board"));
}

}  // namespace
}  // namespace flamefield
