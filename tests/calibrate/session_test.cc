// Sessions with something to find out first: turned boards, gaps between cameras, pictures that say nothing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calibrate/calibrate.h"
#include "calibrate/corner_order.h"
#include "tests/calibrate/synthetic.h"

namespace flamefield {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

Session session_with(int cameras, int poses, const BoardSpec& board, std::uint64_t seed) {
  Session out;
  out.board = board;
  out.truth = ring_with_tolerances({.cameras = cameras, .seed = seed});
  out.poses = board_poses({.count = poses, .last_azimuth_rad = (cameras - 1) * 0.2094395, .seed = seed});
  out.detections = synthetic_session(out.truth, out.poses, out.board, 0.1, seed);
  out.options.world_from_reference = out.poses[0];
  out.options.focal_px = 1212;
  return out;
}
Result<CalibrationReport> solved(const Session& session) {
  return calibrate(session.detections, session.board, session.options);
}
void hide(Session& session, const auto& which) {
  for (Detection& d : session.detections) {
    if (!which(d)) continue;
    d.corners_px.clear();
    d.reason = "too dark: nothing";
  }
}

TEST(LookAlikeTurns, MapTheBoardOntoItself) {
  for (const auto& [board, turns] : std::vector<std::pair<BoardSpec, std::size_t>>{
           {{9, 6, 12}, 1}, {{8, 6, 12}, 2}, {{7, 5, 12}, 2}, {{7, 7, 12}, 2}, {{6, 6, 12}, 4}}) {
    const auto found = look_alike_turns(board);
    ASSERT_EQ(found.size(), turns) << board.cols << 'x' << board.rows;
    const auto corners = corners_mm(board);
    for (const BoardTurn& turn : found) {
      for (std::size_t i = 0; i < corners.size(); ++i)
        EXPECT_LT((turn.turn * corners[i] - corners[turn.from[i]]).norm(), 1e-9);
    }
  }
}

TEST(CornerOrder, ViewsNumberedFromTheOtherEndAreRenumberedAndCounted) {
  for (const BoardSpec& board : {BoardSpec{8, 6, 10}, BoardSpec{6, 6, 12}}) {
    SCOPED_TRACE(board.cols);
    const Session straight = session_with(6, 10, board, 31);
    Session turned = straight;
    const auto turns = look_alike_turns(board);
    int count = 0, renumbered = 0;
    for (Detection& d : turned.detections) {
      if (!d.found() || ++count % 4 != 0 || d.pose == pose_name(0)) continue;
      d.corners_px = reordered(d.corners_px, turns[1 + static_cast<std::size_t>(count) % (turns.size() - 1)]);
      ++renumbered;
    }
    const auto a = solved(straight), b = solved(turned);
    ASSERT_TRUE(a) << a.error().message;
    ASSERT_TRUE(b) << b.error().message;
    EXPECT_EQ(a->turned_views, 0);
    EXPECT_GT(b->turned_views, renumbered / 2);  // a pose that is mostly turned keeps the turned order
    EXPECT_EQ(a->rejected_corners, b->rejected_corners);
    EXPECT_LT(volume_error_px(b->rig, a->rig, {})->worst_px, 1e-3);
  }
}

TEST(Links, NameTheNeighboursThatNeedACommonPose) {
  Session session = session_with(6, 10, {}, 32);
  hide(session, [](const Detection& d) {
    const bool first_part = d.camera < "cam03", even = (d.pose.back() - '0') % 2 == 0;
    return first_part != even;
  });
  const auto refused = solved(session);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("not tied to the other cameras: cam03, cam04, cam05"));
  EXPECT_THAT(refused.error().message, HasSubstr("cam02 and cam03"));
  session.options.require_connected = false;
  const auto report = solved(session);
  ASSERT_TRUE(report) << report.error().message;
  ASSERT_EQ(report->missing_links.size(), 1u);
  EXPECT_EQ(report->missing_links[0].connected, "cam02");
  EXPECT_EQ(report->missing_links[0].loose, "cam03");
}

TEST(Links, ACameraWithoutAnyBoardIsNamedWithTheReason) {
  Session session = session_with(4, 8, {}, 33);
  hide(session, [](const Detection& d) { return d.camera == "cam01"; });
  EXPECT_THAT(solved(session).error().message,
              HasSubstr("cam01 saw no board in 8 images, 8 times for: too dark"));
  std::erase_if(session.detections, [](const Detection& d) { return d.camera == "cam01"; });
  EXPECT_TRUE(solved(session));
  for (const Camera& camera : session.truth.cameras) session.options.cameras.push_back(camera.name);
  EXPECT_THAT(solved(session).error().message, HasSubstr("cam01 has no images"));
}

TEST(Session, APictureThatIsGivenTwiceCountsOnce) {
  Session session = session_with(4, 8, {}, 34);
  const auto once = solved(session);
  for (std::size_t i = 0, n = session.detections.size(); i < n; ++i) {
    if (session.detections[i].pose != pose_name(3)) continue;
    session.detections.push_back(session.detections[i]);
    session.detections.back().pose = "again";
  }
  const auto twice = solved(session);
  ASSERT_TRUE(once && twice);
  EXPECT_EQ(twice->corners, once->corners);
  EXPECT_THAT(twice->views.back().reason, HasSubstr("same picture as pose03"));
  for (Detection& d : session.detections) {
    const auto first = std::ranges::find_if(session.detections, [&](const Detection& f) {
      return f.camera == d.camera && f.pose == pose_name(0);
    });
    d.corners_px = first->corners_px;
  }
  EXPECT_THAT(solved(session).error().message, HasSubstr("only one board pose"));
}

// Wherever memory happens to lie: Ceres sums in the order of addresses.
TEST(Session, SolvedAgainItIsTheSameToTheLastBit) {
  const Session session = session_with(6, 10, {8, 6, 10}, 41);
  const auto once = solved(session);
  ASSERT_TRUE(once) << once.error().message;
  std::mt19937_64 engine(5);
  for (int repeat = 0; repeat < 4; ++repeat) {
    // Holes of all sizes, so that the next blocks come to lie in another order.
    std::vector<std::vector<double>> litter;
    for (int i = 0; i < 400; ++i) litter.emplace_back(1 + engine() % 3000);
    for (std::size_t i = 0; i < litter.size(); ++i)
      if (engine() % 2 == 0) std::vector<double>().swap(litter[i]);
    const auto again = solved(session);
    ASSERT_TRUE(again);
    for (std::size_t c = 0; c < once->rig.cameras.size(); ++c) {
      const Camera &a = once->rig.cameras[c], &b = again->rig.cameras[c];
      EXPECT_EQ(a.fx_px, b.fx_px) << repeat << ' ' << a.name;
      EXPECT_EQ(a.distortion, b.distortion);
      EXPECT_EQ(a.camera_from_world.rotation, b.camera_from_world.rotation);
      EXPECT_EQ(a.camera_from_world.translation_mm, b.camera_from_world.translation_mm);
      EXPECT_EQ(once->rig.quality->cameras[c].position_sigma_mm,
                again->rig.quality->cameras[c].position_sigma_mm);
    }
    EXPECT_EQ(once->expected_volume_error.mean_px, again->expected_volume_error.mean_px);
    EXPECT_EQ(once->split_half->translation_mm, again->split_half->translation_mm);
  }
}

TEST(Session, BoardsThatAreAllParallelCannotTellTheLens) {
  Session session = session_with(5, 8, {}, 35);
  for (std::size_t k = 0; k < session.poses.size(); ++k) {
    const double shift = 3.0 * static_cast<double>(k);
    session.poses[k] = upright_board({shift, 40 - shift, 0.5 * shift}, 2 * 0.2094395);
  }
  session.options.world_from_reference = session.poses[0];
  session.options.focal_px.reset();
  session.detections = synthetic_session(session.truth, session.poses, session.board, 0.1, 35);
  const auto refused = solved(session);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("parallel"));
  session.options.intrinsics = IntrinsicsMode::Fixed;
  session.options.known = session.truth.cameras;
  EXPECT_TRUE(solved(session));
}

}  // namespace
}  // namespace flamefield
