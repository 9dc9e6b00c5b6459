#include "calibrate/detect.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "acquire/simulator/board_scene.h"
#include "tests/calibrate/synthetic.h"

namespace flamefield {
namespace {

using testing::HasSubstr;

Camera some_camera() {
  return ring_with_tolerances({.cameras = 1}).cameras[0];
}

struct Seen {
  std::vector<Eigen::Vector2d> truth;
  Detection detection;
  double rms_px() const {
    double sum = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) sum += (truth[i] - detection.corners_px[i]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(truth.size()));
  }
};
Seen seen(double obliquity_deg, double defocus_sigma_px, const BoardSpec& board) {
  const Camera camera = some_camera();
  const Rigid3 pose = upright_board({3, 42, -5}, obliquity_deg * std::numbers::pi / 180);
  BoardScene scene;
  scene.board = board;
  scene.defocus_sigma_px = defocus_sigma_px;
  Image image = with_noise(render_board(camera, pose, scene), scene.full_scale_electrons, 17);
  return {true_corners(camera, pose, board, 80).value(),
          detect_board({camera.name, "pose", std::move(image)}, board)};
}

TEST(Detect, CornersAreWithinEightHundredthsOfAPixelUpToFiftyFiveDegrees) {
  for (double blur : {0.7, 1.5}) {
    for (double angle : {-55.0, -30.0, 0.0, 20.0, 45.0, 55.0}) {
      const Seen s = seen(angle, blur, {});
      ASSERT_TRUE(s.detection.found()) << angle << " deg, blur " << blur << ": " << s.detection.reason;
      EXPECT_LT(s.rms_px(), 0.08) << angle << " deg, blur " << blur;
    }
  }
}

TEST(Detect, AnUpsideDownBoardKeepsItsCornerNumbers) {
  const Camera camera = some_camera();
  const BoardScene scene;
  const Rigid3 half_turn{Eigen::Vector3d(-1, -1, 1).asDiagonal(), Eigen::Vector3d::Zero()};
  const Rigid3 pose = upright_board({0, 40, 0}, 0.3) * half_turn;
  const Image image = with_noise(render_board(camera, pose, scene), scene.full_scale_electrons, 3);
  const Detection detection = detect_board({camera.name, "pose", image}, scene.board);
  ASSERT_TRUE(detection.found()) << detection.reason;
  const auto truth = *true_corners(camera, pose, scene.board);
  EXPECT_LT((detection.corners_px.front() - truth.front()).norm(), 0.3);
  EXPECT_LT((detection.corners_px.back() - truth.back()).norm(), 0.3);
}

TEST(Detect, RowsMayOutnumberColumns) {
  const Seen s = seen(20, 0.7, {4, 7, 12});
  ASSERT_TRUE(s.detection.found()) << s.detection.reason;
  EXPECT_LT(s.rms_px(), 0.08);
}

TEST(Detect, TheScaleOfGreyLevelsDoesNotMatter) {
  const Camera camera = some_camera();
  const BoardScene scene;
  Image image = render_board(camera, upright_board({0, 40, 0}, 0.2), scene);
  const Detection electrons = detect_board({camera.name, "pose", image}, scene.board);
  for (float& value : image.pixels) value = 0.01f * value + 3;
  const Detection scaled = detect_board({camera.name, "pose", image}, scene.board);
  ASSERT_TRUE(electrons.found() && scaled.found());
  EXPECT_LT((electrons.corners_px[7] - scaled.corners_px[7]).norm(), 0.02);
}

TEST(Detect, SaysWhyThereIsNoBoard) {
  const Camera camera = some_camera();
  const BoardScene scene;
  const Image back = render_board(camera, upright_board({0, 40, 0}, std::numbers::pi), scene);
  EXPECT_THAT(detect_board({"c", "p", with_noise(back, 15000, 1)}, scene.board).reason,
              HasSubstr("no board"));
  EXPECT_EQ(detect_board({"c", "p", Image(64, 48, 100)}, scene.board).reason, "no contrast");
  EXPECT_EQ(detect_board({"c", "p", Image()}, scene.board).reason, "empty image");
}

TEST(Detect, TakesABoardThatLooksTheSameUpsideDownToStandUpright) {
  for (const BoardSpec& board :
       {BoardSpec{8, 6, 12}, BoardSpec{7, 5, 12}, BoardSpec{6, 6, 12}, BoardSpec{7, 7, 12}}) {
    SCOPED_TRACE(board.cols);
    const Seen s = seen(20, 0.7, board);
    ASSERT_TRUE(s.detection.found()) << s.detection.reason;
    EXPECT_LT(s.rms_px(), 0.08);
  }
}

TEST(Detect, AnyNumberOfThreadsGivesTheSameInTheSameOrder) {
  const Camera camera = some_camera();
  const BoardScene scene;
  std::vector<BoardView> views;
  for (int k = 0; k < 6; ++k) {
    const Rigid3 pose = upright_board({0, 40, 0}, 0.3 * k);
    views.push_back({camera.name, pose_name(static_cast<std::size_t>(k)),
                     with_noise(render_board(camera, pose, scene), scene.full_scale_electrons, 5)});
  }
  std::size_t last = 0;
  const auto one = detect(views, scene.board, {.threads = 1});
  const auto three = detect(views, scene.board, {.threads = 3, .progress = [&](std::size_t n) { last = n; }});
  ASSERT_TRUE(one && three);
  EXPECT_EQ(last, views.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    EXPECT_EQ((*three)[i].pose, views[i].pose);
    EXPECT_EQ((*one)[i].corners_px, (*three)[i].corners_px);
  }
}

}  // namespace
}  // namespace flamefield
