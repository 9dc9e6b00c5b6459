#include "calibrate/bundle.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <memory>

#include "calibrate/reprojection.h"

namespace flamefield {

namespace {

constexpr double kAlwaysRadialSigma = 2;  // k2 of a long lens is all but invisible: keeps Free solvable

// The bundle's unknowns as Ceres wants them, in the order of its Jacobian's columns.
struct Blocks {
  std::vector<LensBlock> lenses;
  std::vector<PoseBlock> cameras, boards;
};

Blocks blocks_of(const Bundle& bundle) {
  Blocks blocks;
  for (const Camera& camera : bundle.cameras) {
    blocks.lenses.push_back(lens_block(camera));
    blocks.cameras.push_back(pose_block(camera.camera_from_world));
  }
  for (const Rigid3& pose : bundle.world_from_board) blocks.boards.push_back(pose_block(pose));
  return blocks;
}

std::vector<int> constant_lens_indices(const BundleOptions& options) {
  std::vector<int> constant;
  if (!options.free_aspect) constant.push_back(kAspect);
  if (!options.free_tangential) constant.insert(constant.end(), {kP1, kP2});
  if (!options.free_k3) constant.push_back(kK3);
  return constant;
}

// Standard deviation of each lens parameter; 0: no prior.
LensBlock lens_sigmas(const Camera& known, bool focal_known, const BundleOptions& options) {
  LensBlock sigma{};
  sigma[kK1] = sigma[kK2] = sigma[kK3] = kAlwaysRadialSigma;
  if (options.intrinsics != IntrinsicsMode::Prior) return sigma;
  const IntrinsicsPrior& prior = options.prior;
  if (focal_known) sigma[kFocal] = prior.focal_relative * known.fx_px;
  sigma[kCx] = sigma[kCy] = prior.centre_relative * known.image_width_px;
  sigma[kK1] = sigma[kK2] = prior.radial;
  return sigma;
}

void add_prior(ceres::Problem& problem, LensBlock& lens, const Camera& known, bool focal_known,
               const BundleOptions& options) {
  const LensBlock centre = lens_block(known), sigma = lens_sigmas(known, focal_known, options);
  ceres::Matrix weights = ceres::Matrix::Zero(9, 9);
  ceres::Vector middle(9);
  for (int i = 0; i < 9; ++i) {
    const auto k = static_cast<std::size_t>(i);
    // In units of the corners' noise, so that a prior counts as much as it is worth.
    weights(i, i) = sigma[k] > 0 ? options.noise_px / sigma[k] : 0;
    middle[i] = centre[k];
  }
  problem.AddResidualBlock(new ceres::NormalPrior(weights, middle), nullptr, lens.data());
}

// Board poses first: they are the blocks to eliminate.
void build(ceres::Problem& problem, const Bundle& bundle, const BundleOptions& options, Blocks& blocks) {
  for (PoseBlock& board : blocks.boards) problem.AddParameterBlock(board.data(), 7, new PoseManifold);
  if (!options.hold_cameras) problem.SetParameterBlockConstant(blocks.boards[bundle.fixed_pose].data());
  for (std::size_t c = 0; c < blocks.cameras.size(); ++c) {
    problem.AddParameterBlock(blocks.cameras[c].data(), 7, new PoseManifold);
    problem.AddParameterBlock(blocks.lenses[c].data(), 9);
    if (options.hold_cameras) problem.SetParameterBlockConstant(blocks.cameras[c].data());
    if (options.hold_cameras || options.intrinsics == IntrinsicsMode::Fixed) {
      problem.SetParameterBlockConstant(blocks.lenses[c].data());
      continue;
    }
    const std::vector<int> constant = constant_lens_indices(options);
    if (!constant.empty()) {
      problem.SetManifold(blocks.lenses[c].data(), new ceres::SubsetManifold(9, constant));
    }
    add_prior(problem, blocks.lenses[c], bundle.known[c], bundle.focal_known[c], options);
  }
  for (const BundleView& view : bundle.views) {
    for (std::size_t i = 0; i < view.corners_px.size(); ++i) {
      if (!view.used[i]) continue;
      problem.AddResidualBlock(new ReprojectionCost(bundle.board_mm[i], view.corners_px[i]),
                               options.robust_px > 0 ? new ceres::HuberLoss(options.robust_px) : nullptr,
                               blocks.lenses[view.camera].data(), blocks.cameras[view.camera].data(),
                               blocks.boards[view.pose].data());
    }
  }
}

int lens_freedom(const BundleOptions& options) {
  if (options.intrinsics == IntrinsicsMode::Fixed) return 0;
  return 9 - static_cast<int>(constant_lens_indices(options).size());
}

// Normal matrix J^T J of the whole problem, dense: a few hundred unknowns.
Eigen::MatrixXd normal_matrix(ceres::Problem& problem, const std::vector<double*>& order) {
  ceres::Problem::EvaluateOptions what;
  what.parameter_blocks = order;
  what.apply_loss_function = false;
  ceres::CRSMatrix j;
  problem.Evaluate(what, nullptr, nullptr, nullptr, &j);
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(j.num_cols, j.num_cols);
  for (std::size_t row = 0; row + 1 < j.rows.size(); ++row) {
    const auto first = static_cast<std::size_t>(j.rows[row]),
               last = static_cast<std::size_t>(j.rows[row + 1]);
    for (std::size_t a = first; a < last; ++a) {
      for (std::size_t b = first; b < last; ++b) normal(j.cols[a], j.cols[b]) += j.values[a] * j.values[b];
    }
  }
  return normal;
}

// Centre C = -R^T t moves by -R^T (d_t + t x d) under the tangent (d, d_t).
Eigen::Matrix<double, 3, 6> centre_by_tangent(const Rigid3& camera_from_world) {
  const Eigen::Vector3d& t = camera_from_world.translation_mm;
  Eigen::Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  Eigen::Matrix<double, 3, 6> out;
  out << -camera_from_world.rotation.transpose() * cross, -camera_from_world.rotation.transpose();
  return out;
}

// Covariance block of one camera -> sigmas. `free` lists the lens parameters behind the block's tail.
CameraSigma sigma_of(const Camera& camera, const Eigen::MatrixXd& covariance, const std::vector<int>& free,
                     std::span<const Eigen::Vector3d> volume_mm) {
  CameraSigma out;
  const Eigen::Matrix<double, 3, 6> by_pose = centre_by_tangent(camera.camera_from_world);
  out.position_mm = std::sqrt((by_pose * covariance.topLeftCorner<6, 6>() * by_pose.transpose()).trace());
  out.rotation_rad = std::sqrt(covariance.topLeftCorner<3, 3>().trace());
  for (std::size_t i = 0; i < free.size(); ++i) {
    const auto at = 6 + static_cast<Eigen::Index>(i);
    if (free[i] == kFocal) out.focal_px = std::sqrt(covariance(at, at));
  }
  const LensBlock lens = lens_block(camera);
  const PoseBlock pose = pose_block(camera.camera_from_world), world = pose_block(Rigid3());
  double sum = 0;
  for (const Eigen::Vector3d& point : volume_mm) {
    Eigen::Matrix<double, 2, 9, Eigen::RowMajor> by_lens;
    Eigen::Matrix<double, 2, 7, Eigen::RowMajor> by_camera;
    Eigen::Vector2d pixel;
    const double* parameters[] = {lens.data(), pose.data(), world.data()};
    double* jacobians[] = {by_lens.data(), by_camera.data(), nullptr};
    if (!ReprojectionCost(point, Eigen::Vector2d::Zero()).Evaluate(parameters, pixel.data(), jacobians))
      continue;
    Eigen::MatrixXd by_both(2, covariance.cols());
    by_both.leftCols<6>() = by_camera.leftCols<6>();
    for (std::size_t i = 0; i < free.size(); ++i) {
      by_both.col(6 + static_cast<Eigen::Index>(i)) = by_lens.col(free[i]);
    }
    sum += (by_both * covariance * by_both.transpose()).trace();
  }
  if (!volume_mm.empty()) out.volume_px = std::sqrt(sum / static_cast<double>(volume_mm.size()));
  return out;
}

}  // namespace

BundleSummary solve_bundle(Bundle& bundle, const BundleOptions& options) {
  Blocks blocks = blocks_of(bundle);
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
  for (PoseBlock& board : blocks.boards) ordering->AddElementToGroup(board.data(), 0);
  for (std::size_t c = 0; c < blocks.cameras.size(); ++c) {
    ordering->AddElementToGroup(blocks.cameras[c].data(), 1);
    ordering->AddElementToGroup(blocks.lenses[c].data(), 1);
  }
  solver.linear_solver_ordering = ordering;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);

  for (std::size_t c = 0; c < bundle.cameras.size(); ++c) {
    if (options.hold_cameras) break;
    set_lens(bundle.cameras[c], blocks.lenses[c]);
    bundle.cameras[c].camera_from_world = rigid3_from(blocks.cameras[c]);
  }
  for (std::size_t p = 0; p < blocks.boards.size(); ++p) {
    if (options.hold_cameras || p != bundle.fixed_pose)
      bundle.world_from_board[p] = rigid3_from(blocks.boards[p]);
  }
  return {summary.termination_type == ceres::CONVERGENCE,
          summary.num_successful_steps + summary.num_unsuccessful_steps, summary.message};
}

Eigen::Vector2d residual_px(const Bundle& bundle, const BundleView& view, std::size_t corner) {
  const auto pixel =
      project(bundle.cameras[view.camera], bundle.world_from_board[view.pose] * bundle.board_mm[corner]);
  return pixel ? Eigen::Vector2d(*pixel - view.corners_px[corner]) : Eigen::Vector2d(1e6, 1e6);
}

std::vector<CameraSigma> camera_sigmas(const Bundle& bundle, const BundleOptions& options, double sigma_px,
                                       std::span<const Eigen::Vector3d> volume_mm) {
  BundleOptions plain = options;
  plain.robust_px = 0;
  plain.noise_px = sigma_px;
  Blocks blocks = blocks_of(bundle);
  ceres::Problem problem;
  build(problem, bundle, plain, blocks);
  std::vector<double*> order;
  const bool has_lens = plain.intrinsics != IntrinsicsMode::Fixed;
  for (std::size_t c = 0; c < blocks.cameras.size(); ++c) {
    order.push_back(blocks.cameras[c].data());
    if (has_lens) order.push_back(blocks.lenses[c].data());
  }
  for (std::size_t p = 0; p < blocks.boards.size(); ++p) {
    if (p != bundle.fixed_pose) order.push_back(blocks.boards[p].data());
  }
  const Eigen::LLT<Eigen::MatrixXd> normal(normal_matrix(problem, order));
  if (normal.info() != Eigen::Success) return {};

  const std::vector<int> constant = constant_lens_indices(plain);
  std::vector<int> free;
  for (int i = 0; has_lens && i < 9; ++i) {
    if (std::find(constant.begin(), constant.end(), i) == constant.end()) free.push_back(i);
  }
  const Eigen::Index width = 6 + static_cast<Eigen::Index>(free.size());
  const Eigen::Index unknowns = normal.rows(),
                     of_cameras = width * static_cast<Eigen::Index>(bundle.cameras.size());
  const Eigen::MatrixXd columns = normal.solve(Eigen::MatrixXd::Identity(unknowns, of_cameras));
  std::vector<CameraSigma> sigmas;
  for (std::size_t c = 0; c < bundle.cameras.size(); ++c) {
    const Eigen::Index at = width * static_cast<Eigen::Index>(c);
    const Eigen::MatrixXd covariance = sigma_px * sigma_px * columns.block(at, at, width, width);
    sigmas.push_back(sigma_of(bundle.cameras[c], covariance, free, volume_mm));
  }
  return sigmas;
}

int free_parameters(const Bundle& bundle, const BundleOptions& options) {
  return static_cast<int>(bundle.cameras.size()) * (6 + lens_freedom(options)) +
         6 * (static_cast<int>(bundle.world_from_board.size()) - 1);
}

}  // namespace flamefield
