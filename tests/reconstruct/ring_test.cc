#include "reconstruct/ring.h"

#include <gtest/gtest.h>

#include <cmath>

namespace flamefield {
namespace {

TEST(Ring, CentresFollowTheSphericalCoordinatesOfThePaper) {
  const Grid grid = centred_grid(40, 40, 40, 1);
  const auto rig = make_ring({.views = 8, .spacing_rad = 0.4, .radius_mm = 200, .elevation_rad = 0.3}, grid);
  ASSERT_TRUE(rig.has_value());
  for (std::size_t k = 0; k < 8; ++k) {
    const double phi = 0.4 * static_cast<double>(k), theta = M_PI / 2 - 0.3;
    const Eigen::Vector3d expected = 200 * Eigen::Vector3d(std::sin(theta) * std::cos(phi), std::cos(theta),
                                                           std::sin(theta) * std::sin(phi));
    EXPECT_LT((rig->cameras[k].centre_mm() - expected).norm(), 1e-9);
    EXPECT_TRUE(validate(rig->cameras[k]).has_value());
  }
}

TEST(Ring, TheCentreOfTheDomainIsInTheMiddleOfEveryImage) {
  Grid grid = centred_grid(40, 30, 40, 1);
  grid.origin_mm += Eigen::Vector3d(5, 60, -7);
  const auto rig = make_ring({.views = 5, .radius_mm = 200, .elevation_rad = -0.2}, grid);
  ASSERT_TRUE(rig.has_value());
  for (const Camera& c : rig->cameras) {
    const auto pixel = project(c, 0.5 * (grid.lower_mm() + grid.upper_mm()));
    ASSERT_TRUE(pixel.has_value());
    EXPECT_NEAR(pixel->x(), 19.5, 1e-9);
    EXPECT_NEAR(pixel->y(), 14.5, 1e-9);
  }
}

TEST(Ring, TheFaceOfTheBoxNearestTheCameraFillsTheView) {
  const Grid grid = centred_grid(40, 40, 40, 2);
  const auto rig =
      make_ring({.views = 1, .radius_mm = 300, .image_width_px = 80, .image_height_px = 80}, grid);
  ASSERT_TRUE(rig.has_value());
  // The camera stands on +x; up in the world is up in the image, and +z is on its left.
  const auto corner = project(rig->cameras[0], {40, 40, 40});
  ASSERT_TRUE(corner.has_value());
  EXPECT_NEAR(corner->x(), -0.5, 1e-9);
  EXPECT_NEAR(corner->y(), -0.5, 1e-9);
}

TEST(Ring, ACameraInsideTheDomainIsRefused) {
  const auto rig = make_ring({.radius_mm = 30}, centred_grid(40, 40, 40, 1));
  ASSERT_FALSE(rig.has_value());
  EXPECT_NE(rig.error().message.find("radius_mm=30"), std::string::npos);
}

}  // namespace
}  // namespace flamefield
