#include "calibrate/charuco.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstdio>

#include "acquire/simulator/board_scene.h"
#include "calibrate/check.h"
#include "calibrate/corner_order.h"
#include "tests/calibrate/synthetic.h"

namespace flamefield {
namespace {

using testing::HasSubstr;

// Squares wide enough that a marker's corners stay clear of the board's.
const BoardSpec kBoard{8, 5, 15, BoardKind::Charuco, 10, "4X4_50"};

Image picture(const Camera& camera, const Rigid3& pose, double defocus_sigma_px = 0.7) {
  BoardScene scene;
  scene.board = kBoard;
  scene.markers = marker_patterns(kBoard);
  scene.defocus_sigma_px = defocus_sigma_px;
  return with_noise(render_board(camera, pose, scene), scene.full_scale_electrons, 5);
}

struct Score {
  int seen = 0;
  double rms_px = 0, worst_px = 0;
};
Score score(const Detection& detection, const Camera& camera, const Rigid3& pose) {
  Score out;
  const auto corners = corners_mm(kBoard);
  for (std::size_t i = 0; i < detection.corners_px.size(); ++i) {
    if (!is_seen(detection.corners_px[i])) continue;
    const double off = (detection.corners_px[i] - *project(camera, pose * corners[i])).norm();
    ++out.seen;
    out.rms_px += off * off;
    out.worst_px = std::max(out.worst_px, off);
  }
  out.rms_px = std::sqrt(out.rms_px / std::max(1, out.seen));
  return out;
}

TEST(Charuco, CornersAreWithinATenthOfAPixelUpToFiftyDegrees) {
  const Camera camera = ring_with_tolerances({.cameras = 1}).cameras[0];
  for (double angle : {-50.0, -25.0, 0.0, 30.0, 50.0}) {
    const Rigid3 pose = upright_board({3, 42, -5}, angle * std::numbers::pi / 180);
    const Detection detection = detect_board({camera.name, "pose", picture(camera, pose)}, kBoard);
    ASSERT_TRUE(detection.found()) << angle << ": " << detection.reason;
    const Score s = score(detection, camera, pose);
    std::printf("%.0f deg: %d of %zu corners, %.3f px RMS, worst %.3f\n", angle, s.seen, kBoard.corners(),
                s.rms_px, s.worst_px);
    EXPECT_GE(s.seen, 36) << angle;
    EXPECT_LT(s.rms_px, 0.1) << angle;
  }
}

TEST(Charuco, APartOfTheBoardIsEnoughAndItsCornersKeepTheirNumbers) {
  const Camera camera = ring_with_tolerances({.cameras = 1}).cameras[0];
  for (double aside_mm : {-120.0, 120.0}) {
    const Rigid3 pose = upright_board({0, 40, aside_mm}, 0.2);
    const Detection detection = detect_board({camera.name, "pose", picture(camera, pose)}, kBoard);
    ASSERT_TRUE(detection.found()) << aside_mm << ": " << detection.reason;
    const Score s = score(detection, camera, pose);
    EXPECT_GT(s.seen, 8) << aside_mm;
    EXPECT_LT(s.seen, 40) << aside_mm;
    EXPECT_LT(s.worst_px, 0.4) << aside_mm;
  }
}

TEST(Charuco, AnUpsideDownBoardKeepsItsCornerNumbers) {
  const Camera camera = ring_with_tolerances({.cameras = 1}).cameras[0];
  const Rigid3 half_turn{Eigen::Vector3d(-1, -1, 1).asDiagonal(), Eigen::Vector3d::Zero()};
  const Rigid3 pose = upright_board({0, 40, 0}, 0.3) * half_turn;
  const Detection detection = detect_board({camera.name, "pose", picture(camera, pose)}, kBoard);
  ASSERT_TRUE(detection.found()) << detection.reason;
  EXPECT_LT(score(detection, camera, pose).worst_px, 0.4);
  EXPECT_EQ(look_alike_turns(kBoard).size(), 1u);
}

TEST(Charuco, SaysWhyThereIsNoBoard) {
  const Camera camera = ring_with_tolerances({.cameras = 1}).cameras[0];
  const Image back = picture(camera, upright_board({0, 40, 0}, std::numbers::pi));
  EXPECT_THAT(detect_board({camera.name, "pose", back}, kBoard).reason, HasSubstr("no ChArUco board"));
  BoardSpec other = kBoard;
  other.dictionary = "6X6_250";
  const Image image = picture(camera, upright_board({0, 40, 0}, 0.1));
  EXPECT_THAT(detect_board({camera.name, "pose", image}, other).reason, HasSubstr("0 of its 27 markers"));
}

TEST(Charuco, RefusesDictionariesThatDoNotExistOrAreTooSmall) {
  BoardSpec board = kBoard;
  board.dictionary = "4X4_51";
  EXPECT_FALSE(check_dictionary(board));
  board = {12, 10, 15, BoardKind::Charuco, 10, "4X4_50"};
  const auto small = check_dictionary(board);
  ASSERT_FALSE(small);
  EXPECT_THAT(small.error().message, HasSubstr("has 50 markers"));
  board.marker_mm = 14.9;
  EXPECT_FALSE(validate(board));
}

// Boards that reach over the edges of most pictures, and a camera that only ever sees the half of one.
TEST(Charuco, ARingIsCalibratedFromPartsOfTheBoard) {
  const std::uint64_t seed = 6;
  SCOPED_TRACE(seed);
  const Rig truth = ring_with_tolerances({.cameras = 4, .seed = seed});
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<BoardView> views;
  std::vector<Rigid3> poses = {upright_board({0, 40, 0}, 0.31)};
  while (poses.size() < 9) {
    const Rigid3 tilt{(Eigen::AngleAxisd(0.35 * uniform(engine), Eigen::Vector3d::UnitX()) *
                       Eigen::AngleAxisd(0.3 * uniform(engine), Eigen::Vector3d::UnitZ()))
                          .toRotationMatrix(),
                      Eigen::Vector3d::Zero()};
    poses.push_back(upright_board({60 * uniform(engine), 40 + 110 * uniform(engine), 150 * uniform(engine)},
                                  0.31 + 0.5 * uniform(engine)) *
                    tilt);
  }
  for (const Camera& camera : truth.cameras)
    for (std::size_t k = 0; k < poses.size(); ++k)
      views.push_back({camera.name, pose_name(k), picture(camera, poses[k])});
  const auto detections = detect(views, kBoard);
  ASSERT_TRUE(detections) << detections.error().message;
  int whole = 0, part = 0;
  for (const Detection& d : *detections) {
    if (!d.found()) continue;
    (count_seen(d.corners_px) == kBoard.corners() ? whole : part)++;
  }
  EXPECT_GT(part, 5);
  const auto report = calibrate(*detections, kBoard, {.world_from_reference = poses[0]});
  ASSERT_TRUE(report) << report.error().message;
  const auto error = volume_error_px(report->rig, truth, {});
  ASSERT_TRUE(error);
  std::printf("%d whole boards, %d in part: RMS %.3f px, volume error %.3f px, worst %.3f\n", whole, part,
              report->rms_px, error->mean_px, error->worst_px);
  EXPECT_LT(error->worst_px, 0.2);
  EXPECT_LT(report->rms_px, 0.12);
  const auto checked = check(truth, *detections, kBoard);
  ASSERT_TRUE(checked) << checked.error().message;
  EXPECT_TRUE(checked->moved.empty());
}

}  // namespace
}  // namespace flamefield
