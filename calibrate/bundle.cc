#include "calibrate/bundle.h"

#include <ceres/ceres.h>

#include <cmath>
#include <memory>

#include "calibrate/bundle_problem.h"

namespace flamefield {

namespace {

int lens_freedom(const BundleOptions& options) {
  if (options.intrinsics == IntrinsicsMode::Fixed) return 0;
  return 9 - static_cast<int>(constant_lens_indices(options).size());
}

}  // namespace

BundleSummary solve_bundle(Bundle& bundle, const BundleOptions& options) {
  Blocks blocks(bundle);
  ceres::Problem problem;
  build(problem, bundle, options, blocks);

  ceres::Solver::Options solver;
  solver.max_num_iterations = options.max_iterations;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.num_threads = 1;
  solver.function_tolerance = 1e-8;
  solver.parameter_tolerance = 1e-9;
  solver.logging_type = ceres::SILENT;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (std::size_t p = 0; p < blocks.boards(); ++p) ordering->AddElementToGroup(blocks.board(p), 0);
  for (std::size_t c = 0; c < blocks.cameras(); ++c) {
    ordering->AddElementToGroup(blocks.camera(c), 1);
    ordering->AddElementToGroup(blocks.lens(c), 1);
  }
  ordering->AddElementToGroup(blocks.bow(), 1);
  solver.linear_solver_ordering = ordering;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);

  for (std::size_t c = 0; c < bundle.cameras.size(); ++c) {
    if (options.hold_cameras) break;
    set_lens(bundle.cameras[c], blocks.lens_of(c));
    bundle.cameras[c].camera_from_world = blocks.camera_pose(c);
  }
  bundle.bow_mm = {blocks.bow()[0], blocks.bow()[1]};
  for (std::size_t p = 0; p < blocks.boards(); ++p) {
    if (options.hold_cameras || p != bundle.fixed_pose) bundle.world_from_board[p] = blocks.board_pose(p);
  }
  return {summary.termination_type == ceres::CONVERGENCE,
          summary.num_successful_steps + summary.num_unsuccessful_steps, summary.message};
}

std::vector<Eigen::Vector2d> bow_shapes(std::span<const Eigen::Vector3d> board_mm) {
  Eigen::Vector2d half(1e-9, 1e-9), mean(0, 0);
  for (const Eigen::Vector3d& p : board_mm) half = half.cwiseMax(p.head<2>().cwiseAbs());
  std::vector<Eigen::Vector2d> shapes;
  for (const Eigen::Vector3d& p : board_mm) {
    shapes.emplace_back(Eigen::Vector2d(1, 1) - p.head<2>().cwiseQuotient(half).cwiseAbs2());
    mean += shapes.back() / static_cast<double>(board_mm.size());
  }
  for (Eigen::Vector2d& shape : shapes) shape -= mean;
  return shapes;
}

std::vector<Eigen::Vector2d> residuals_px(const Bundle& bundle, const BundleView& view) {
  const std::vector<Eigen::Vector2d> shapes = bow_shapes(bundle.board_mm);
  std::vector<Eigen::Vector2d> residuals;
  for (std::size_t i = 0; i < view.corners_px.size(); ++i) {
    const Eigen::Vector3d point = bundle.board_mm[i] + Eigen::Vector3d(0, 0, shapes[i].dot(bundle.bow_mm));
    const auto pixel = project(bundle.cameras[view.camera], bundle.world_from_board[view.pose] * point);
    residuals.push_back(pixel ? Eigen::Vector2d(*pixel - view.corners_px[i]) : Eigen::Vector2d(1e6, 1e6));
  }
  return residuals;
}

int free_parameters(const Bundle& bundle, const BundleOptions& options) {
  return static_cast<int>(bundle.cameras.size()) * (6 + lens_freedom(options)) +
         6 * (static_cast<int>(bundle.world_from_board.size()) - 1) + (estimates_bow(options) ? 2 : 0);
}

}  // namespace flamefield
