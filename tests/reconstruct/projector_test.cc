#include "reconstruct/projector.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

#include "reconstruct/metrics.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/problem.h"
#include "reconstruct/render.h"
#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

struct Case {
  std::string name;
  bool crooked;
  ProjectorOptions options;
};

class ProjectorTest : public testing::TestWithParam<Case> {
 protected:
  Grid grid = [] {
    Grid g = centred_grid(14, 17, 12, 1.3);
    g.spacing_mm = {1.3, 1.1, 1.5};
    return g;
  }();
  Rig rig = GetParam().crooked ? crooked_ring(grid, 4) : level_ring(grid, 4);
  Team team{2};
  Projector projector = *Projector::make(rig, grid, GetParam().options, team);
  const Layout& layout = projector.layout();

  std::vector<float> random_volume(std::uint64_t seed) const {
    return layout.pack_volume(random_values(grid.voxels(), seed));
  }
  std::vector<float> random_images(std::uint64_t seed) const {
    return layout.pack_images(random_values(plain_pixels(), seed));
  }
  std::size_t plain_pixels() const { return projector.views() * std::size_t(layout.rows * layout.cols); }
};

TEST_P(ProjectorTest, AdjointIsTheTransposeOfForward) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    const auto x = random_volume(seed), y = random_images(seed + 100);
    std::vector<float> ax(layout.pixels()), aty(layout.voxels());
    projector.forward(team, x, ax);
    projector.adjoint(team, y, aty);
    const double left = dot(ax, y), right = dot(x, aty);
    EXPECT_GT(left, 0);
    EXPECT_LE(std::abs(left - right), 1e-5 * std::abs(left));
  }
}

TEST_P(ProjectorTest, AColumnIsTheImageOfItsVoxel) {
  std::vector<ColumnEntry> column;
  std::vector<float> x(grid.voxels()), packed(layout.pixels());
  for (std::size_t voxel = 0; voxel < grid.voxels(); voxel += 41) {
    x.assign(grid.voxels(), 0);
    x[voxel] = 1;
    projector.forward(team, layout.pack_volume(x), packed);
    auto ax = layout.unpack_images(packed);
    projector.column(voxel, column);
    for (const ColumnEntry& e : column) {
      EXPECT_NEAR(ax[e.pixel], e.weight, 1e-5);
      ax[e.pixel] = 0;
    }
    for (float rest : ax) EXPECT_NEAR(rest, 0, 1e-6);
  }
}

TEST_P(ProjectorTest, ForwardAgreesWithTheRenderer) {
  Volume volume(grid);
  volume.values = random_values(grid.voxels(), 3);
  const bool area = GetParam().options.pixel_area;
  const auto rendered = render(volume, rig,
                               GetParam().options.trilinear
                                   ? RenderOptions{.pixel_samples = GetParam().options.pixel_samples}
                                   : RenderOptions{.step_voxels = 0.05, .pixel_samples = area ? 8 : 1});
  ASSERT_TRUE(rendered.has_value());
  std::vector<float> packed(layout.pixels());
  projector.forward(team, layout.pack_volume(volume.values), packed);
  const auto ax = layout.unpack_images(packed);
  if (GetParam().options.trilinear) {  // the same discretisation
    for (std::size_t i = 0; i < ax.size(); ++i) EXPECT_NEAR(ax[i], rendered->values[i], 1e-4);
  } else if (GetParam().options.f_number > 0) {
    double sum = 0, sharp = 0;  // a lens moves light about, it takes none
    for (std::size_t i = 0; i < ax.size(); ++i) sum += ax[i], sharp += rendered->values[i];
    EXPECT_NEAR(sum, sharp, 0.02 * sharp);
  } else {  // another rule of integration, which white noise shows at its worst
    EXPECT_LT(relative_distance(ax, rendered->values), area ? 0.06 : 0.09);
  }
}

TEST_P(ProjectorTest, SubsetsOfViewsAddUpToTheWhole) {
  const auto y = random_images(8);
  std::vector<float> whole(layout.voxels()), part(layout.voxels()), sum(layout.voxels(), 0);
  projector.adjoint(team, y, whole);
  for (const std::vector<std::size_t>& views :
       {std::vector<std::size_t>{0, 2}, std::vector<std::size_t>{1, 3}}) {
    projector.adjoint(team, views, y, part);
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += part[i];
  }
  for (std::size_t i = 0; i < sum.size(); ++i) EXPECT_NEAR(sum[i], whole[i], 1e-3);
}

TEST_P(ProjectorTest, ResultsAreBitIdenticalForAnyNumberOfThreads) {
  Team one(1), three(3);
  const auto x = random_volume(1), y = random_images(2);
  std::vector<float> a(layout.pixels()), b(a), c(layout.voxels()), d(c);
  projector.forward(one, x, a);
  projector.forward(three, x, b);
  projector.adjoint(one, y, c);
  projector.adjoint(three, y, d);
  EXPECT_EQ(a, b);
  EXPECT_EQ(c, d);
}

INSTANTIATE_TEST_SUITE_P(
    Engines, ProjectorTest,
    testing::Values(
        Case{"LevelArea", false, {}}, Case{"LevelCentralRay", false, {.pixel_area = false}},
        Case{"CrookedArea", true, {}}, Case{"LevelLens", false, {.f_number = 1.4, .focal_length_mm = 8}},
        Case{"CrookedLens", true, {.f_number = 1.4, .focal_length_mm = 8}},
        Case{"CrookedCentralRay", true, {.pixel_area = false}},
        Case{"LevelStored", false, {.trilinear = true, .pixel_samples = 1}},
        Case{"LevelStoredSubPixels", false, {.trilinear = true, .pixel_samples = 2}},
        Case{"CrookedStored", true, {.trilinear = true, .pixel_samples = 2}},
        Case{"LevelTraced", false, {.trilinear = true, .pixel_samples = 1, .memory_budget_mib = 0}},
        Case{"CrookedTraced", true, {.trilinear = true, .pixel_samples = 2, .memory_budget_mib = 0}}),
    [](const auto& tested) { return tested.param.name; });

TEST(Projector, TracesAnewWhenTheMatrixIsOverBudget) {
  const Grid grid = centred_grid(16, 16, 16, 1);
  const Rig rig = level_ring(grid, 3);
  Team team(1);
  EXPECT_EQ(Projector::make(rig, grid, {.trilinear = true, .memory_budget_mib = 0.1}, team)->engine(),
            "traced");
  EXPECT_EQ(Projector::make(rig, grid, {.trilinear = true}, team)->engine().substr(0, 6), "stored");
}

// Relative L2 distance of projections of a flame, made finer and averaged, from those of the ray tracer.
double distance_from_ray_tracer(const Rig& rig, bool area) {
  const Grid fine = centred_grid(104, 110, 104, 0.66), grid = centred_grid(52, 55, 52, 1.32);
  static const Volume flame = resample(make_phantom({.kind = PhantomKind::Stratified}, fine), grid);
  Team team(2);
  const Projector projector = *Projector::make(rig, grid, {.pixel_area = area}, team);
  EXPECT_NE(projector.engine().find("level"), std::string::npos) << projector.engine();
  std::vector<float> packed(projector.layout().pixels());
  projector.forward(team, projector.layout().pack_volume(flame.values), packed);
  const auto traced = render(flame, rig, {.step_voxels = 0.5, .pixel_samples = area ? 4 : 1});
  const double distance = relative_distance(projector.layout().unpack_images(packed), traced->values);
  std::cout << (area ? "pixel area: " : "central ray: ") << 100 * distance << " %\n";
  return distance;
}

// Long columns: the volume is worked on in slabs of planes and tiles of columns, whose borders nobody must
// see.
TEST(Projector, TilesOfALargeVolumeFitTogether) {
  const Grid grid = centred_grid(70, 500, 68, 1);
  const Rig rig = *make_ring(
      {.views = 3, .spacing_rad = 0.9, .radius_mm = 3000, .image_width_px = 80, .image_height_px = 480},
      grid);
  Team team(2);
  const Projector projector = *Projector::make(rig, grid, {}, team);
  const Layout& layout = projector.layout();
  const auto x = layout.pack_volume(random_values(grid.voxels(), 1));
  std::vector<float> ax(layout.pixels()), aty(layout.voxels());
  const auto y = layout.pack_images(random_values(3 * 80 * 480, 2));
  projector.forward(team, x, ax);
  projector.adjoint(team, y, aty);
  EXPECT_NEAR(dot(ax, y) / dot(x, aty), 1, 1e-5);
  const auto plain_y = layout.unpack_images(y), plain_aty = layout.unpack_volume(aty);
  std::vector<ColumnEntry> column;
  for (std::size_t voxel = 0; voxel < grid.voxels(); voxel += 97) {
    projector.column(voxel, column);
    double sum = 0;
    for (const ColumnEntry& e : column)
      sum += static_cast<double>(e.weight) * static_cast<double>(plain_y[e.pixel]);
    ASSERT_NEAR(plain_aty[voxel], sum, 1e-3) << voxel;
  }
}

TEST(Projector, LevelCamerasAgreeWithTheRayTracerOnAFlame) {
  const Rig rig = *make_ring({}, centred_grid(52, 55, 52, 1.32));
  EXPECT_LT(distance_from_ray_tracer(rig, true), 0.005);
  EXPECT_LT(distance_from_ray_tracer(rig, false), 0.009);
}

TEST(Projector, ALensBlursWhatIsOutOfFocusAsRaysThroughItsApertureDo) {
  const Grid grid = centred_grid(40, 40, 40, 1.5);
  const Volume torus = make_phantom({.kind = PhantomKind::Torus}, grid);
  const Rig rig = *make_ring({.views = 3, .radius_mm = 200}, grid);
  Team team(2);
  const auto distance = [&](const ProjectorOptions& options, const RenderOptions& traced) {
    const auto made = Projector::make(rig, grid, options, team);
    EXPECT_TRUE(made) << made.error().message;
    if (!made) return 1.0;
    const Projector& projector = *made;
    std::vector<float> packed(projector.layout().pixels());
    projector.forward(team, projector.layout().pack_volume(torus.values), packed);
    return relative_distance(projector.layout().unpack_images(packed), render(torus, rig, traced)->values);
  };
  const ProjectorOptions pinhole, lens = {.f_number = 4, .focal_length_mm = 35, .focus_distance_mm = 150};
  const RenderOptions traced = {
      .step_voxels = 0.5, .pixel_samples = 2, .lens = {.aperture_mm = 8.75, .focus_mm = 150}};
  EXPECT_GT(distance(pinhole, traced), 0.02);
  EXPECT_LT(distance(lens, traced), 0.01);
}

TEST(Projector, AnApertureWithoutItsLensIsRefused) {
  const Grid grid = centred_grid(8, 8, 8, 1);
  Team team(1);
  const auto made = Projector::make(level_ring(grid, 2), grid, {.f_number = 2}, team);
  ASSERT_FALSE(made);
  EXPECT_NE(made.error().message.find("focal_length_mm"), std::string::npos);
}

TEST(Projector, TiltedAndDistortedCamerasAgreeWithTheRayTracerOnAFlame) {
  Rig rig = *make_ring({}, centred_grid(52, 55, 52, 1.32));
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    Camera& c = rig.cameras[i];
    const double k = static_cast<double>(i % 5) - 2;
    const Eigen::Matrix3d tilt = (Eigen::AngleAxisd(0.02 * k, Eigen::Vector3d::UnitZ()) *
                                  Eigen::AngleAxisd(0.01 * k, Eigen::Vector3d::UnitX()))
                                     .toRotationMatrix();
    c.camera_from_world = Rigid3{tilt, Eigen::Vector3d::Zero()} * c.camera_from_world;
    c.distortion = {-0.3, 0.1, 0.001, -0.002, 0.0};
  }
  EXPECT_LT(distance_from_ray_tracer(rig, true), 0.007);
}

TEST(Projector, CamerasOfDifferentSizesAreRefused) {
  const Grid grid = centred_grid(8, 8, 8, 1);
  Rig rig = level_ring(grid, 2);
  rig.cameras[1].image_height_px = 9;
  Team team(1);
  EXPECT_FALSE(Projector::make(rig, grid, {}, team).has_value());
}

}  // namespace
}  // namespace flamefield
