#include "proto/volume.h"

#include <gtest/gtest.h>

#include <cmath>

namespace flamefield {
namespace {

TEST(Volume, SampleIsExactForALinearField) {
  Volume volume(centred_grid(7, 5, 6, 2.0));
  const auto field = [](const Eigen::Vector3d& p) { return 1 + 2 * p.x() - 3 * p.y() + 0.5 * p.z(); };
  for (int z = 0; z < 6; ++z) {
    for (int y = 0; y < 5; ++y) {
      for (int x = 0; x < 7; ++x)
        volume.at(x, y, z) = static_cast<float>(field(volume.grid.voxel_centre_mm(x, y, z)));
    }
  }
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(0.3, -1.7, 2.2), {-5.9, 3.9, -4.9}, {0, 0, 0}}) {
    EXPECT_NEAR(sample(volume, p), field(p), 1e-5) << p.transpose();
  }
}

TEST(Volume, SampleIsZeroOutsideTheOuterFaces) {
  const Volume volume(centred_grid(4, 4, 4, 1.0), 1.0f);
  EXPECT_EQ(sample(volume, {1.99, 0, 0}), 1.0f);
  EXPECT_EQ(sample(volume, {2.01, 0, 0}), 0.0f);
  EXPECT_EQ(sample(volume, {0, NAN, 0}), 0.0f);
}

TEST(Volume, CentredGridHasItsCentreAtTheWorldOrigin) {
  const Grid grid = centred_grid(4, 5, 6, 0.5);
  EXPECT_LT((grid.lower_mm() + grid.upper_mm()).norm(), 1e-12);
}

TEST(Volume, ImpossibleGridsAreRefused) {
  EXPECT_FALSE(validate(centred_grid(0, 5, 5, 1)));
  EXPECT_FALSE(validate(centred_grid(5, 5, 5, 0)));
  EXPECT_FALSE(validate(centred_grid(5, 5, 5, NAN)));
  EXPECT_FALSE(validate(centred_grid(1 << 12, 1 << 12, 1 << 12, 1)));
}

}  // namespace
}  // namespace flamefield
