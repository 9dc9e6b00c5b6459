#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "reconstruct/analytic/fdk.h"
#include "reconstruct/analytic/ring_geometry.h"
#include "reconstruct/metrics.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/render.h"
#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

constexpr double kDeg = std::numbers::pi / 180;

struct Scan {
  int views;
  double step_deg;
  double radius = 8;  // in widths of the domain; a small one has a wide fan
};

Rig ring_of(const Scan& scan, const Grid& grid) {
  return *make_ring({.views = scan.views,
                     .spacing_rad = scan.step_deg * kDeg,
                     .radius_mm = scan.radius * grid.nx * grid.spacing_mm.x(),
                     .image_width_px = scan.radius < 8 ? 2 * grid.nx : grid.nx,
                     .image_height_px = scan.radius < 8 ? 2 * grid.ny : grid.ny},
                    grid);
}

// Exact line integrals of a ball of field 1: 2 sqrt(r^2 - d^2), d the distance of the ray from its centre.
Projections ball_images(const Rig& rig, const Eigen::Vector3d& centre_mm, double radius_mm) {
  Projections out;
  out.rows = rig.cameras[0].image_height_px;
  out.cols = rig.cameras[0].image_width_px;
  for (const Camera& camera : rig.cameras) {
    out.view_names.push_back(camera.name);
    for (int row = 0; row < out.rows; ++row)
      for (int col = 0; col < out.cols; ++col) {
        const Ray ray = pixel_ray(camera, {col, row});
        const double d = ray.direction.cross(centre_mm - ray.origin_mm).norm();
        out.values.push_back(
            static_cast<float>(d < radius_mm ? 2 * std::sqrt(radius_mm * radius_mm - d * d) : 0));
      }
  }
  return out;
}

class FdkScan : public testing::TestWithParam<Scan> {};

TEST_P(FdkScan, RecoversABallOffTheAxisFromItsExactProjections) {
  const Grid grid = centred_grid(20, 20, 20, 1.6);
  const Rig rig = ring_of(GetParam(), grid);
  const Eigen::Vector3d centre(4, 3, -3);
  const Recipe recipe{"fdk", {{"fdk.window", std::string("ramp")}, {"projector.memory_budget_mib", 0.0}}};
  const auto out = reconstruct(ball_images(rig, centre, 8), rig, grid, recipe, {});
  ASSERT_TRUE(out) << out.error().message;
  double inside = 0, outside = 0;
  int n_inside = 0, n_outside = 0;
  for (int z = 0; z < grid.nz; ++z)
    for (int y = 0; y < grid.ny; ++y)
      for (int x = 0; x < grid.nx; ++x) {
        const double d = (grid.voxel_centre_mm(x, y, z) - centre).norm(), value = out->volume.at(x, y, z);
        if (d < 6) inside += value, ++n_inside;
        if (d > 10) outside += value, ++n_outside;
        if (d < 5) {
          EXPECT_NEAR(value, 1, 0.15) << x << ' ' << y << ' ' << z;
        }
      }
  EXPECT_NEAR(inside / n_inside, 1, 0.02);
  EXPECT_NEAR(outside / n_outside, 0, 0.012);
}

// By number, step and radius: half a turn, half a turn and the fan (Parker's weights), three quarters, a
// whole turn, and that clockwise.
INSTANTIATE_TEST_SUITE_P(Scans, FdkScan,
                         testing::Values(Scan{90, 2}, Scan{100, 2}, Scan{135, 2}, Scan{180, 2}, Scan{180, -2},
                                         Scan{125, 2, 1.5}, Scan{125, -2, 1.5}),
                         [](const auto& tested) {
                           const int turn = static_cast<int>(tested.param.views * tested.param.step_deg);
                           return std::string(turn < 0 ? "clockwise" : "over") + "_" +
                                  std::to_string(std::abs(turn)) + "_deg" +
                                  (tested.param.radius < 8 ? "_wide" : "");
                         });

TEST(Fdk, RecoversAGaussianWithEveryWindow) {
  const Grid grid = centred_grid(20, 20, 20, 1.6);
  const Volume truth = make_phantom({.kind = PhantomKind::Gaussian}, grid);
  const Rig rig = ring_of({90, 2}, grid);
  const Projections images = *render(truth, rig, {.pixel_samples = 2});
  Team team;
  const auto projector = *Projector::make(rig, grid, {.pixel_samples = 1, .memory_budget_mib = 0}, team);
  for (const char* window : {"ramp", "shepp-logan", "hann"}) {
    const auto out = reconstruct(images, projector, {"fdk", {{"fdk.window", std::string(window)}}}, {});
    ASSERT_TRUE(out) << out.error().message;
    const auto m = compare(truth, out->volume);
    EXPECT_GT(m->pearson, 0.99) << window;
    EXPECT_LT(m->sqmd, 0.04) << window;
  }
}

TEST(RingGeometry, FindsCentreRadiusAndStep) {
  Grid grid = centred_grid(20, 20, 20, 1);
  grid.origin_mm += Eigen::Vector3d(30, -5, 70);
  const auto ring = ring_geometry(ring_of({40, -9}, grid).cameras);
  ASSERT_TRUE(ring) << ring.error().message;
  EXPECT_NEAR((ring->centre_mm - Eigen::Vector3d(30, -5, 70)).norm(), 0, 1e-6);
  EXPECT_NEAR(ring->radius_mm, 160, 1e-6);
  EXPECT_NEAR(std::abs(ring->step_rad), 9 * kDeg, 1e-9);
  EXPECT_NEAR(ring->coverage_rad, 360 * kDeg, 1e-6);
}

TEST(RingGeometry, OtherGeometriesAreRefusedWithTheCameraAtFault) {
  const Grid grid = centred_grid(20, 20, 20, 1);
  const auto message = [](const Rig& rig) {
    const auto ring = ring_geometry(rig.cameras);
    return ring ? std::string("accepted") : ring.error().message;
  };
  const auto changed = [&](const Rigid3& motion) {
    Rig rig = ring_of({20, 9}, grid);
    rig.cameras[7].camera_from_world = motion * rig.cameras[7].camera_from_world;
    return rig;
  };
  const auto turned = [](const Eigen::Vector3d& axis) {
    return Rigid3{Eigen::AngleAxisd(0.05, axis).toRotationMatrix(), Eigen::Vector3d::Zero()};
  };
  const auto moved = [](double x, double y, double z) {
    return Rigid3{Eigen::Matrix3d::Identity(), Eigen::Vector3d(x, y, z)};
  };
  const auto contains = [](const std::string& text, const char* part) {
    return text.find(part) != std::string::npos;
  };
  EXPECT_EQ(message(changed({})), "accepted");
  for (const auto& [rig, fault] : {std::pair{changed(turned(Eigen::Vector3d::UnitZ())), "cam07 is not level"},
                                   std::pair{changed(turned(Eigen::Vector3d::UnitX())), "cam07 is not level"},
                                   std::pair{changed(turned(Eigen::Vector3d::UnitY())), "cam07 looks past"},
                                   std::pair{changed(moved(0, 6, 0)), "cam07 stands"},
                                   std::pair{changed(moved(0, 0, 9)), "cam07 stands"}}) {
    EXPECT_TRUE(contains(message(rig), fault)) << message(rig);
  }
  Rig uneven = ring_of({20, 9}, grid);
  uneven.cameras.erase(uneven.cameras.begin() + 7);
  EXPECT_TRUE(contains(message(uneven), "deg after its neighbour")) << message(uneven);
  EXPECT_TRUE(contains(message(ring_of({10, 9}, grid)), "cover 90 deg")) << message(ring_of({10, 9}, grid));
  EXPECT_TRUE(contains(message(ring_of({2, 90}, grid)), "2 cameras"));
  Rig bent = ring_of({20, 9}, grid);
  bent.cameras[3].distortion[0] = 0.1;
  EXPECT_TRUE(contains(message(bent), "cam03 has a distorting lens")) << message(bent);
  const auto elevated =
      make_ring({.views = 20, .spacing_rad = 9 * kDeg, .radius_mm = 160, .elevation_rad = 0.2}, grid);
  EXPECT_TRUE(contains(message(*elevated), "is not level")) << message(*elevated);
}

}  // namespace
}  // namespace flamefield
