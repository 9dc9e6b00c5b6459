#include "services/calibration/flame_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstdio>

#include "reconstruct/phantom/phantom.h"
#include "reconstruct/render.h"
#include "reconstruct/ring.h"

namespace flamefield {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr int kVoxels = 36;

struct Scene {
  Grid grid = centred_grid(kVoxels, kVoxels, kVoxels, 2.0);
  Rig rig;
  Scene() { rig = make_ring({.views = 15, .radius_mm = 500}, grid).value(); }

  // What the cameras of another rig really saw: rendered from a field twice as fine, with shot noise.
  std::vector<Projections> sets(const Rig& truth, std::uint64_t seed) const {
    std::vector<Projections> out;
    for (int frame = 0; frame < 2; ++frame) {
      const Grid fine = centred_grid(2 * kVoxels, 2 * kVoxels, 2 * kVoxels, 1.0);
      const Volume field = make_phantom({PhantomKind::Stratified, seed, 0.3 * frame}, fine);
      Projections set = render(field, truth, {}).value();
      EXPECT_TRUE(add_noise(set, {.photons = 5000, .seed = seed + 100}));
      out.push_back(std::move(set));
    }
    return out;
  }
  // Camera `k` turned about its own upright or sideways axis, by as many pixels.
  Rig bumped(std::size_t k, double pixels, const Eigen::Vector3d& axis) const {
    Rig out = rig;
    Camera& camera = out.cameras[k];
    const Rigid3 turn{Eigen::AngleAxisd(pixels / camera.fx_px, axis).toRotationMatrix(),
                      Eigen::Vector3d::Zero()};
    camera.camera_from_world = turn * camera.camera_from_world;
    return out;
  }
};

TEST(FlameCheck, NamesTheOneCameraOfFifteenThatWasBumpedByAPixelAndNobodyElse) {
  const Scene scene;
  for (std::uint64_t seed : {1, 2, 3, 4}) {
    SCOPED_TRACE(seed);
    const std::size_t which = 3 * seed;
    const Eigen::Vector3d axis = seed % 2 == 0 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
    const auto bumped = check_by_flame(scene.rig, scene.grid, scene.sets(scene.bumped(which, 1, axis), seed));
    ASSERT_TRUE(bumped) << bumped.error().message;
    EXPECT_THAT(bumped->moved, ElementsAre(scene.rig.cameras[which].name));
    std::printf("seed %d: camera %zu off by %.2f px, the others by %.2f px at the median\n",
                static_cast<int>(seed), which, bumped->cameras[which].shift_px.norm(), bumped->typical_px);
    EXPECT_NEAR(bumped->cameras[which].shift_px.norm(), 1, 0.3);

    const auto still = check_by_flame(scene.rig, scene.grid, scene.sets(scene.rig, seed));
    ASSERT_TRUE(still) << still.error().message;
    EXPECT_THAT(still->moved, IsEmpty());
    double worst = 0;
    for (const FlameDrift& camera : still->cameras) worst = std::max(worst, camera.shift_px.norm());
    std::printf("  nobody moved: median %.2f px, worst %.2f px\n", still->typical_px, worst);
  }
}

TEST(FlameCheck, NamesTwoCameras) {
  const Scene scene;
  Rig truth = scene.bumped(2, 1.5, Eigen::Vector3d::UnitY());
  truth.cameras[9] = scene.bumped(9, -1.5, Eigen::Vector3d::UnitX()).cameras[9];
  const auto found = check_by_flame(scene.rig, scene.grid, scene.sets(truth, 7));
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_THAT(found->moved, testing::UnorderedElementsAre("cam02", "cam09"));
}

TEST(FlameCheck, RefusesWhatItCannotJudge) {
  const Scene scene;
  EXPECT_FALSE(check_by_flame(scene.rig, scene.grid, {}));
  auto sets = scene.sets(scene.rig, 1);
  sets[1].view_names[4] = "cam99";
  EXPECT_FALSE(check_by_flame(scene.rig, scene.grid, sets));
  sets[1].view_names = sets[0].view_names;
  Rig few = scene.rig;
  few.cameras.resize(4);
  const auto refused = check_by_flame(few, scene.grid, sets);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("cam04 is not in the rig"));
  for (Projections& set : sets) std::fill(set.values.begin(), set.values.end(), 0.0f);
  EXPECT_FALSE(check_by_flame(scene.rig, scene.grid, sets));
}

}  // namespace
}  // namespace flamefield
