#include <gtest/gtest.h>

#include "reconstruct/metrics.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/render.h"
#include "reconstruct/ring.h"
#include "reconstruct/solver.h"

namespace flamefield {
namespace {

// Truth three times finer than the reconstruction, more rays and finer steps in the data than in the solver,
// so that no result rests on an inverse crime.
struct Scene {
  Grid grid;
  Rig rig;
  Volume truth;
  Projections images;
};

Scene scene_of(PhantomKind kind, const Grid& grid, const RingOptions& ring, const SensorNoise& noise) {
  const Grid fine = centred_grid(3 * grid.nx, 3 * grid.ny, 3 * grid.nz, grid.spacing_mm.x() / 3);
  const Volume field = make_phantom({.kind = kind}, fine);
  Scene scene{grid, *make_ring(ring, grid), resample(field, grid), {}};
  scene.images = *render(field, scene.rig, {.step_voxels = 0.5, .pixel_samples = 3});
  EXPECT_TRUE(add_noise(scene.images, noise).has_value());
  return scene;
}

FieldMetrics solve(const Scene& scene, const Recipe& recipe, double time_limit_s = 0) {
  const auto out = reconstruct(scene.images, scene.rig, scene.grid, recipe, {.time_limit_s = time_limit_s});
  EXPECT_TRUE(out.has_value());
  return *compare(scene.truth, out->volume);
}

TEST(SolverSlow, EverySolverRecoversTheStratifiedFlameFromNoisy8BitImages) {
  const Scene scene =
      scene_of(PhantomKind::Stratified, centred_grid(52, 55, 52, 1.32), {}, {.photons = 2500, .bits = 8});
  for (const char* solver : {"osem", "mlem", "sirt", "os-sart"}) {
    const FieldMetrics m = solve(scene, {solver, {}});
    EXPECT_GT(m.pearson, 0.975) << solver;
    EXPECT_LT(m.sqmd, 0.05) << solver;
  }
}

}  // namespace
}  // namespace flamefield
