#include "calibrate/bundle_problem.h"

#include <ceres/loss_function.h>
#include <ceres/normal_prior.h>

namespace flamefield {

Blocks::Blocks(const Bundle& bundle)
    : boards_(bundle.world_from_board.size()),
      cameras_(bundle.cameras.size()),
      values_(kPose * boards_ + kCamera * cameras_ + 2) {
  for (std::size_t p = 0; p < boards_; ++p)
    std::ranges::copy(pose_block(bundle.world_from_board[p]), board(p));
  for (std::size_t c = 0; c < cameras_; ++c) {
    std::ranges::copy(pose_block(bundle.cameras[c].camera_from_world), camera(c));
    std::ranges::copy(lens_block(bundle.cameras[c]), lens(c));
  }
  bow()[0] = bundle.bow_mm.x();
  bow()[1] = bundle.bow_mm.y();
}

std::vector<int> constant_lens_indices(const BundleOptions& options) {
  std::vector<int> constant;
  if (!options.free_aspect) constant.push_back(kAspect);
  if (!options.free_tangential) constant.insert(constant.end(), {kP1, kP2});
  if (!options.free_k3) constant.push_back(kK3);
  return constant;
}

bool estimates_bow(const BundleOptions& options) {
  return options.free_bow && !options.hold_cameras;
}

namespace {

constexpr double kBowSigma_mm = 5;        // nobody calibrates with a board bent more than this
constexpr double kAlwaysRadialSigma = 2;  // k2 of a long lens is all but invisible: keeps Free solvable

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

void add_prior(ceres::Problem& problem, double* lens, const Camera& known, bool focal_known,
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
  problem.AddResidualBlock(new ceres::NormalPrior(weights, middle), nullptr, lens);
}

// Board poses first: they are the blocks to eliminate.
void add_blocks(ceres::Problem& problem, const Bundle& bundle, const BundleOptions& options, Blocks& blocks) {
  for (std::size_t p = 0; p < blocks.boards(); ++p)
    problem.AddParameterBlock(blocks.board(p), 7, new PoseManifold);
  if (!options.hold_cameras) problem.SetParameterBlockConstant(blocks.board(bundle.fixed_pose));
  for (std::size_t c = 0; c < blocks.cameras(); ++c) {
    problem.AddParameterBlock(blocks.camera(c), 7, new PoseManifold);
    problem.AddParameterBlock(blocks.lens(c), 9);
    if (options.hold_cameras) problem.SetParameterBlockConstant(blocks.camera(c));
    if (options.hold_cameras || options.intrinsics == IntrinsicsMode::Fixed) {
      problem.SetParameterBlockConstant(blocks.lens(c));
      continue;
    }
    const std::vector<int> constant = constant_lens_indices(options);
    if (!constant.empty()) {
      problem.SetManifold(blocks.lens(c), new ceres::SubsetManifold(9, constant));
    }
    add_prior(problem, blocks.lens(c), bundle.known[c], bundle.focal_known[c], options);
  }
  problem.AddParameterBlock(blocks.bow(), 2);
  if (estimates_bow(options)) {
    const ceres::Matrix weight = ceres::Matrix::Identity(2, 2) * (options.noise_px / kBowSigma_mm);
    problem.AddResidualBlock(new ceres::NormalPrior(weight, ceres::Vector::Zero(2)), nullptr, blocks.bow());
  } else {
    problem.SetParameterBlockConstant(blocks.bow());
  }
}

}  // namespace

std::vector<std::vector<ceres::ResidualBlockId>> build(ceres::Problem& problem, const Bundle& bundle,
                                                       const BundleOptions& options, Blocks& blocks) {
  add_blocks(problem, bundle, options, blocks);
  const std::vector<Eigen::Vector2d> shapes = bow_shapes(bundle.board_mm);
  std::vector<std::vector<ceres::ResidualBlockId>> of_view;
  for (const BundleView& view : bundle.views) {
    auto& added = of_view.emplace_back();
    for (std::size_t i = 0; i < view.corners_px.size(); ++i) {
      if (!view.used[i]) continue;
      added.push_back(problem.AddResidualBlock(
          new ReprojectionCost(bundle.board_mm[i], shapes[i], view.corners_px[i]),
          options.robust_px > 0 ? new ceres::HuberLoss(options.robust_px) : nullptr, blocks.lens(view.camera),
          blocks.camera(view.camera), blocks.board(view.pose), blocks.bow()));
    }
  }
  return of_view;
}

}  // namespace flamefield
