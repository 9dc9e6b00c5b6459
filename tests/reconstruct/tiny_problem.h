#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>

#include "reconstruct/problem.h"
#include "tests/reconstruct/support.h"

namespace flamefield {

// A problem small enough for dense algebra: 36 voxels, seen by 5 cameras at 36 degrees.
struct TinyProblem {
  Grid grid = centred_grid(4, 3, 3, 1);
  Rig rig = *make_ring({.views = 5,
                        .spacing_rad = 0.6283185307179586,
                        .radius_mm = 12,
                        .image_width_px = 9,
                        .image_height_px = 8},
                       grid);
  Team team{2};
  Projector projector = *Projector::make(rig, grid, {}, team);
  SolveControl control;
  Eigen::MatrixXd a = dense(projector);  // pixels x voxels, plain order

  static Eigen::MatrixXd dense(const Projector& projector) {
    Eigen::MatrixXd a = Eigen::MatrixXd::Zero(
        static_cast<Eigen::Index>(projector.views()) * projector.rows() * projector.cols(),
        static_cast<Eigen::Index>(projector.grid().voxels()));
    std::vector<ColumnEntry> column;
    for (Eigen::Index j = 0; j < a.cols(); ++j) {
      projector.column(static_cast<std::size_t>(j), column);
      for (const ColumnEntry& e : column) a(e.pixel, j) += static_cast<double>(e.weight);
    }
    return a;
  }
  Eigen::VectorXd random(Eigen::Index n, std::uint64_t seed) const {
    const auto values = random_values(static_cast<std::size_t>(n), seed);
    return Eigen::Map<const Eigen::VectorXf>(values.data(), n).cast<double>();
  }
  // Images in the solvers' layout.
  std::vector<float> packed_images(const Eigen::VectorXd& b) const {
    const Eigen::VectorXf values = b.cast<float>();
    return projector.layout().pack_images({values.data(), static_cast<std::size_t>(values.size())});
  }
  Eigen::VectorXd plain(std::span<const float> packed_volume) const {
    const auto values = projector.layout().unpack_volume(packed_volume);
    return Eigen::Map<const Eigen::VectorXf>(values.data(), static_cast<Eigen::Index>(values.size()))
        .cast<double>();
  }
  Problem problem(std::span<const float> images, bool non_negative = false) {
    Problem out{projector, images, control, team};
    out.non_negative = non_negative;
    return out;
  }
  // L^T L of the gradient with flat ends.
  Eigen::MatrixXd gradient_penalty() const {
    Eigen::MatrixXd p = Eigen::MatrixXd::Zero(a.cols(), a.cols());
    const auto join = [&](std::size_t i, std::size_t j) {
      const auto m = static_cast<Eigen::Index>(i), n = static_cast<Eigen::Index>(j);
      p(m, m) += 1;
      p(n, n) += 1;
      p(m, n) -= 1;
      p(n, m) -= 1;
    };
    for (int z = 0; z < grid.nz; ++z)
      for (int y = 0; y < grid.ny; ++y)
        for (int x = 0; x < grid.nx; ++x) {
          if (x + 1 < grid.nx) join(grid.index(x, y, z), grid.index(x + 1, y, z));
          if (y + 1 < grid.ny) join(grid.index(x, y, z), grid.index(x, y + 1, z));
          if (z + 1 < grid.nz) join(grid.index(x, y, z), grid.index(x, y, z + 1));
        }
    return p;
  }
};

// Compared with the size of the vectors; NaN fails.
inline void expect_close(const Eigen::VectorXd& found, const Eigen::VectorXd& expected, double tolerance) {
  ASSERT_EQ(found.size(), expected.size());
  EXPECT_LE((found - expected).norm(), tolerance * expected.norm())
      << "found " << found.transpose() << "\nexpected " << expected.transpose();
}

}  // namespace flamefield
