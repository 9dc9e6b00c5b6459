#include "calibrate/corner_order.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <map>

#include "tests/calibrate/synthetic.h"

namespace flamefield {
namespace {

// 1,000 sessions of 6 to 12 board orientations, seen by rings of 4 to 15 cameras, a third of the views
// numbered from the other end. The lenses are known no better than their data sheet.
TEST(CornerOrder, IsNeverWrongInAThousandRandomSessionsWithThirtyPercentTurned) {
  const BoardSpec board{8, 6, 10};
  const std::vector<BoardTurn> turns = look_alike_turns(board);
  ASSERT_EQ(turns.size(), 2u);
  int views = 0, turned = 0, wrong = 0, unsettled = 0;
  for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
    std::mt19937_64 engine(seed);
    const int cameras = std::uniform_int_distribution(4, 15)(engine),
              poses = std::uniform_int_distribution(6, 12)(engine);
    const Rig rig = ring_with_tolerances({.cameras = cameras, .seed = seed});
    const auto world_from_board =
        board_poses({.count = poses, .last_azimuth_rad = (cameras - 1) * 0.2094395, .seed = seed});
    auto detections = synthetic_session(rig, world_from_board, board, 0.1, seed);
    std::vector<bool> is_turned;
    for (Detection& detection : detections) {
      is_turned.push_back(detection.found() && std::uniform_real_distribution(0.0, 1.0)(engine) < 0.3);
      if (is_turned.back()) detection.corners_px = reordered(detection.corners_px, turns[1]);
    }
    const auto sightings = sight(detections, board, {});
    ASSERT_TRUE(sightings) << seed;
    Starts starts{{}, std::vector<bool>(rig.cameras.size(), true)};
    for (Camera camera : rig.cameras) {
      camera.fx_px = camera.fy_px = 1212;
      camera.cx_px = 329;
      camera.cy_px = 246.5;
      camera.distortion = {};
      starts.cameras.push_back(camera);
    }
    const CornerOrder order = agree_on_order(*sightings, starts, board);
    // Which end of a pose is called the first one is free: the order that most of its views end in is right.
    std::map<std::size_t, std::array<int, 2>> ends;
    for (std::size_t v = 0; v < detections.size(); ++v) {
      if (!detections[v].found()) continue;
      ++views;
      turned += is_turned[v];
      unsettled += !order.settled[v];
      if (order.settled[v]) ++ends[sightings->views[v].pose][(order.turn[v] + is_turned[v]) % 2];
    }
    for (const auto& [pose, count] : ends) {
      const int fewer = std::min(count[0], count[1]);
      if (fewer > 0)
        std::printf("seed %llu, pose %zu: %d of %d wrong\n", static_cast<unsigned long long>(seed), pose,
                    fewer, count[0] + count[1]);
      wrong += fewer;
    }
  }
  std::printf("%d views, %d turned, %d wrong, %d unsettled\n", views, turned, wrong, unsettled);
  EXPECT_EQ(wrong, 0);
  EXPECT_LT(unsettled, views / 50);
}

}  // namespace
}  // namespace flamefield
