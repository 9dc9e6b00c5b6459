#include "services/calibration/session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "acquire/simulator/board_scene.h"
#include "acquire/simulator/true_rig.h"
#include "services/calibration/output.h"

namespace flamefield {
namespace {

using testing::AnyOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Five small cameras before which a board is shown, without any bus.
class SmallRing {
 public:
  SmallRing() {
    TrueRigOptions ring;
    ring.cameras = 5;
    ring.spacing_rad = 0.2617993877991494;
    ring.image_width_px = 330;
    ring.image_height_px = 248;
    ring.focal_px = 606;
    rig = ring_with_tolerances(ring);
    poses = board_poses(
        {.count = 12, .last_azimuth_rad = 4 * ring.spacing_rad, .tilt_rad = 0.25, .offset_mm = 10});
  }
  FrameSet set(const Rigid3& pose) const {
    FrameSet out;
    out.kind = CaptureKind::Board;
    const BoardScene scene{.light_gradient = 0.1, .defocus_sigma_px = 0.5};
    for (const Camera& camera : rig.cameras) {
      const Image image = render_board(camera, pose, scene);
      std::vector<std::byte> bytes;
      for (float electrons : image.pixels) {
        const double level = 255 * static_cast<double>(electrons) / scene.full_scale_electrons;
        bytes.push_back(static_cast<std::byte>(std::clamp(std::lround(level), 0l, 255l)));
      }
      Frame frame;
      frame.camera = camera.name;
      frame.width_px = camera.image_width_px;
      frame.height_px = camera.image_height_px;
      frame.bytes = std::make_shared<const std::vector<std::byte>>(std::move(bytes));
      out.frames.push_back(std::move(frame));
    }
    return out;
  }
  CalibrationSessionOptions options() const {
    CalibrationSessionOptions out;
    for (const Camera& camera : rig.cameras) out.cameras.push_back(camera.name);
    out.solving.world_from_reference = poses[0];
    out.wanted_poses = 8;
    return out;
  }
  // Shows each pose until it is taken.
  void run(CalibrationSession& session, std::size_t count) const {
    for (std::size_t k = 0; k < count; ++k) {
      const FrameSet pictures = set(poses[k]);
      for (int look = 0; look < 2; ++look) ASSERT_TRUE(session.look(pictures));
      if (session.is_worth_taking()) {
        ASSERT_TRUE(session.take());
      }
    }
  }

  Rig rig;
  std::vector<Rigid3> poses;
};

TEST(CalibrationSession, TakesABoardOnlyWhenItIsHeldStillInANewPlace) {
  const SmallRing ring;
  CalibrationSession session(ring.options());
  const FrameSet first = ring.set(ring.poses[0]), second = ring.set(ring.poses[1]);
  ASSERT_TRUE(session.look(first));
  EXPECT_FALSE(session.is_worth_taking()) << "one picture cannot tell whether it moves";
  ASSERT_TRUE(session.look(first));
  EXPECT_TRUE(session.is_worth_taking());
  ASSERT_EQ(session.take().value(), "pose000");
  ASSERT_TRUE(session.look(first));
  EXPECT_FALSE(session.is_worth_taking());
  EXPECT_TRUE(session.is_useless());
  ASSERT_TRUE(session.look(second));
  EXPECT_FALSE(session.is_worth_taking()) << "it has just moved";
  ASSERT_TRUE(session.look(second));
  EXPECT_TRUE(session.is_worth_taking());
  // Half a millimetre between two pictures is too much.
  Rigid3 nudged = ring.poses[1];
  nudged.translation_mm += Eigen::Vector3d(0.5, 0.5, 0.5);
  ASSERT_TRUE(session.look(ring.set(nudged)));
  EXPECT_FALSE(session.is_worth_taking());
}

TEST(CalibrationSession, SaysWhatIsStillNeededUntilNothingIs) {
  const SmallRing ring;
  CalibrationSession session(ring.options());
  CalibrationState state;
  session.describe(state);
  EXPECT_THAT(state.needed, ElementsAre(HasSubstr("holder on the burner")));
  std::size_t before = 1000;
  for (std::size_t count : {3u, 12u}) {
    ring.run(session, count);
    session.solve_roughly();
    session.describe(state);
    EXPECT_LT(state.needed.size(), before);
    before = state.needed.size();
  }
  EXPECT_GE(state.poses, 8);
  EXPECT_THAT(state.links_missing, IsEmpty());
  EXPECT_GT(state.cameras[2].boards, 5);
  EXPECT_EQ(state.cameras[2].covered.size(), 9u);
  EXPECT_THAT(state.verdict, AnyOf("green", "amber"));
  ASSERT_TRUE(session.solve());
  session.describe(state);
  EXPECT_GT(state.rms_px, 0);
  EXPECT_EQ(state.previous_version, 0);
  const std::string json = json_text(state);
  for (const char* key : {"\"state\"", "\"boards\"", "\"coverage\"", "\"last_reason\"", "\"needed\"",
                          "\"links_missing\"", "\"verdict\""})
    EXPECT_THAT(json, HasSubstr(key));
}

TEST(CalibrationSession, NamesTheCameraThatHasMovedSinceTheLastCalibration) {
  SmallRing ring;
  CalibrationSessionOptions options = ring.options();
  CalibrationSession first(options);
  ring.run(first, 12);
  ASSERT_TRUE(first.solve());
  options.previous = PreviousCalibration{7, first.report()->rig};
  // Two pixels of these cameras.
  const Rigid3 turn{Eigen::AngleAxisd(2.0 / 606, Eigen::Vector3d::UnitY()).toRotationMatrix(),
                    Eigen::Vector3d::Zero()};
  ring.rig.cameras[3].camera_from_world = turn * ring.rig.cameras[3].camera_from_world;
  CalibrationSession second(options);
  ring.run(second, 12);
  ASSERT_TRUE(second.solve());
  CalibrationState state;
  second.describe(state);
  EXPECT_EQ(state.previous_version, 7);
  EXPECT_THAT(state.moved, ElementsAre("cam03"));
  EXPECT_NEAR(state.cameras[3].shift_px, 2, 0.4);
  EXPECT_LT(state.cameras[1].shift_px, 0.4);
}

TEST(CalibrationSession, RefusesToSolveWhileACameraHangsLooseAndNamesIt) {
  SmallRing ring;
  CalibrationSession session(ring.options());
  for (std::size_t k = 0; k < 6; ++k) {
    FrameSet set = ring.set(ring.poses[k]);
    std::erase_if(set.frames, [](const Frame& frame) { return frame.camera == "cam04"; });
    for (int look = 0; look < 2; ++look) ASSERT_TRUE(session.look(set));
    ASSERT_TRUE(session.take());
  }
  const auto solved = session.solve();
  ASSERT_FALSE(solved);
  EXPECT_THAT(solved.error().message, HasSubstr("cam04"));
  CalibrationState state;
  session.describe(state);
  ASSERT_EQ(state.links_missing.size(), 1u);
  EXPECT_EQ(state.links_missing[0].b, "cam04");
  EXPECT_EQ(state.cameras[4].last_reason, "no picture");
}

}  // namespace
}  // namespace flamefield
