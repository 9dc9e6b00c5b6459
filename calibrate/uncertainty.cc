#include "calibrate/uncertainty.h"

#include <ceres/crs_matrix.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "calibrate/bundle_problem.h"

namespace flamefield {

namespace {

// Where each estimated block begins among the unknowns; cameras first, each pose followed by its lens.
struct Layout {
  std::vector<int> free_lens;  // estimated lens parameters (see LensIndex)
  Eigen::Index camera_width = 6;
  std::vector<Eigen::Index> board;  // -1: held
  Eigen::Index bow = -1;            // -1: held
  Eigen::Index unknowns = 0;

  Eigen::Index camera(std::size_t c) const { return camera_width * static_cast<Eigen::Index>(c); }
};

Layout layout_of(const Bundle& bundle, const BundleOptions& options) {
  Layout out;
  if (options.intrinsics != IntrinsicsMode::Fixed) {
    const std::vector<int> constant = constant_lens_indices(options);
    for (int i = 0; i < 9; ++i)
      if (std::ranges::find(constant, i) == constant.end()) out.free_lens.push_back(i);
  }
  out.camera_width += std::ssize(out.free_lens);
  out.unknowns = out.camera(bundle.cameras.size());
  for (std::size_t p = 0; p < bundle.world_from_board.size(); ++p) {
    out.board.push_back(p == bundle.fixed_pose ? -1 : out.unknowns);
    if (p != bundle.fixed_pose) out.unknowns += 6;
  }
  if (estimates_bow(options)) {
    out.bow = out.unknowns;
    out.unknowns += 2;
  }
  return out;
}

std::vector<double*> order_of(Blocks& blocks, const Layout& layout) {
  std::vector<double*> order;
  for (std::size_t c = 0; c < blocks.cameras(); ++c) {
    order.push_back(blocks.camera(c));
    if (!layout.free_lens.empty()) order.push_back(blocks.lens(c));
  }
  for (std::size_t p = 0; p < blocks.boards(); ++p)
    if (layout.board[p] >= 0) order.push_back(blocks.board(p));
  if (layout.bow >= 0) order.push_back(blocks.bow());
  return order;
}

// Unknowns that one view depends on.
std::vector<Eigen::Index> unknowns_of(const BundleView& view, const Layout& layout) {
  std::vector<Eigen::Index> out;
  const auto add = [&](Eigen::Index first, Eigen::Index count) {
    for (Eigen::Index i = 0; i < count && first >= 0; ++i) out.push_back(first + i);
  };
  add(layout.camera(view.camera), layout.camera_width);
  add(layout.board[view.pose], 6);
  add(layout.bow, 2);
  return out;
}

Eigen::MatrixXd dense(const ceres::CRSMatrix& j) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(j.num_rows, j.num_cols);
  for (int row = 0; row < j.num_rows; ++row) {
    const auto first = static_cast<std::size_t>(j.rows[static_cast<std::size_t>(row)]),
               last = static_cast<std::size_t>(j.rows[static_cast<std::size_t>(row) + 1]);
    for (std::size_t k = first; k < last; ++k) out(row, j.cols[k]) = j.values[k];
  }
  return out;
}

// J^T J and J^T r of one view, over its own unknowns.
struct ViewNormal {
  std::vector<Eigen::Index> unknowns;
  Eigen::MatrixXd normal;
  Eigen::VectorXd gradient;
};

class Normal {
 public:
  Normal(const Bundle& bundle, const BundleOptions& options) : layout_(layout_of(bundle, options)) {
    Blocks blocks(bundle);
    ceres::Problem problem;
    const auto of_view = build(problem, bundle, options, blocks);
    const std::vector<double*> order = order_of(blocks, layout_);
    std::vector<ceres::ResidualBlockId> priors;
    problem.GetResidualBlocks(&priors);
    std::vector<ceres::ResidualBlockId> of_views;
    for (const auto& ids : of_view) of_views.insert(of_views.end(), ids.begin(), ids.end());
    std::ranges::sort(of_views);
    std::erase_if(priors, [&](auto id) { return std::ranges::binary_search(of_views, id); });

    matrix_ = Eigen::MatrixXd::Zero(layout_.unknowns, layout_.unknowns);
    std::vector<double> residuals;
    if (!priors.empty()) {
      const Eigen::MatrixXd j = jacobian(problem, order, priors, residuals);
      matrix_.diagonal() += j.colwise().squaredNorm();  // priors tie no two unknowns together
    }
    for (std::size_t v = 0; v < of_view.size(); ++v) {
      if (of_view[v].empty()) continue;
      ViewNormal view{unknowns_of(bundle.views[v], layout_), {}, {}};
      const Eigen::MatrixXd j = jacobian(problem, order, of_view[v], residuals)(Eigen::all, view.unknowns);
      view.normal = j.transpose() * j;
      view.gradient = j.transpose() * Eigen::Map<const Eigen::VectorXd>(residuals.data(), j.rows());
      matrix_(view.unknowns, view.unknowns) += view.normal;
      views_.push_back(std::move(view));
    }
  }

  const Layout& layout() const { return layout_; }
  const Eigen::MatrixXd& matrix() const { return matrix_; }
  const std::vector<ViewNormal>& views() const { return views_; }

 private:
  static Eigen::MatrixXd jacobian(ceres::Problem& problem, const std::vector<double*>& order,
                                  const std::vector<ceres::ResidualBlockId>& of,
                                  std::vector<double>& residuals) {
    ceres::Problem::EvaluateOptions what;
    what.parameter_blocks = order;
    what.residual_blocks = of;
    what.apply_loss_function = false;
    ceres::CRSMatrix j;
    problem.Evaluate(what, nullptr, &residuals, nullptr, &j);
    return dense(j);
  }

  Layout layout_;
  Eigen::MatrixXd matrix_;
  std::vector<ViewNormal> views_;
};

// CR2: (I - J C J^T)^(-1/2) r instead of the residuals r, whose share that the fit has swallowed is lost. In
// the view's own unknowns that is f(A C) J^T r with A = J^T J and f(x) = (1 - x)^(-1/2).
Eigen::VectorXd restored_gradient(const ViewNormal& view, const Eigen::MatrixXd& covariance) {
  const Eigen::MatrixXd root =
      Eigen::LLT<Eigen::MatrixXd>(covariance(view.unknowns, view.unknowns)).matrixL();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> inner(root.transpose() * view.normal * root);
  constexpr double kMost = 0.99;  // a view that alone determines something would count without bound
  const Eigen::ArrayXd grown =
      (1 - inner.eigenvalues().array().cwiseMin(kMost).cwiseMax(0.0)).sqrt().inverse();
  const Eigen::MatrixXd& u = inner.eigenvectors();
  const Eigen::VectorXd turned = u.transpose() * (root.transpose() * view.gradient);
  const Eigen::VectorXd restored = u * (grown * turned.array()).matrix();
  return root.transpose().triangularView<Eigen::Upper>().solve(restored);
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

// Pixels of points by the camera's unknowns. (2 x points, camera_width)
Eigen::MatrixXd pixels_by_camera(const Camera& camera, const Layout& layout,
                                 std::span<const Eigen::Vector3d> points_mm) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(2 * std::ssize(points_mm), layout.camera_width);
  const LensBlock lens = lens_block(camera);
  const PoseBlock pose = pose_block(camera.camera_from_world), world = pose_block(Rigid3());
  const BowBlock flat = {};
  for (std::size_t p = 0; p < points_mm.size(); ++p) {
    Eigen::Matrix<double, 2, 9, Eigen::RowMajor> by_lens;
    Eigen::Matrix<double, 2, 7, Eigen::RowMajor> by_pose;
    Eigen::Vector2d pixel;
    const double* parameters[] = {lens.data(), pose.data(), world.data(), flat.data()};
    double* jacobians[] = {by_lens.data(), by_pose.data(), nullptr, nullptr};
    const ReprojectionCost cost(points_mm[p], Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero());
    if (!cost.Evaluate(parameters, pixel.data(), jacobians)) continue;
    const auto row = 2 * static_cast<Eigen::Index>(p);
    out.block<2, 6>(row, 0) = by_pose.leftCols<6>();
    for (std::size_t i = 0; i < layout.free_lens.size(); ++i)
      out.block<2, 1>(row, 6 + static_cast<Eigen::Index>(i)) = by_lens.col(layout.free_lens[i]);
  }
  return out;
}

CameraSigma sigma_of(const Camera& camera, const Eigen::MatrixXd& covariance, const Layout& layout,
                     const Eigen::MatrixXd& by_camera) {
  CameraSigma out;
  const Eigen::Matrix<double, 3, 6> by_pose = centre_by_tangent(camera.camera_from_world);
  out.position_mm = std::sqrt((by_pose * covariance.topLeftCorner<6, 6>() * by_pose.transpose()).trace());
  out.rotation_rad = std::sqrt(covariance.topLeftCorner<3, 3>().trace());
  for (std::size_t i = 0; i < layout.free_lens.size(); ++i) {
    const auto at = 6 + static_cast<Eigen::Index>(i);
    if (layout.free_lens[i] == kFocal) out.focal_px = std::sqrt(covariance(at, at));
  }
  const Eigen::VectorXd variance = (by_camera * covariance).cwiseProduct(by_camera).rowwise().sum();
  for (Eigen::Index p = 0; p + 1 < variance.size(); p += 2)
    out.point_px.push_back(std::sqrt(variance[p] + variance[p + 1]));
  if (!out.point_px.empty())
    out.volume_px = std::sqrt(variance.sum() / static_cast<double>(out.point_px.size()));
  return out;
}

void scale(CameraSigma& sigma, double factor) {
  for (double* value : {&sigma.focal_px, &sigma.position_mm, &sigma.rotation_rad, &sigma.volume_px})
    *value *= factor;
  for (double& value : sigma.point_px) value *= factor;
}

}  // namespace

std::optional<Uncertainty> uncertainty(const Bundle& bundle, const BundleOptions& options, double sigma_px,
                                       std::span<const Eigen::Vector3d> volume_mm) {
  BundleOptions plain = options;
  plain.robust_px = 0;
  plain.noise_px = sigma_px;
  const Normal normal(bundle, plain);
  const Layout& layout = normal.layout();
  const Eigen::LLT<Eigen::MatrixXd> factor(normal.matrix());
  if (factor.info() != Eigen::Success) return std::nullopt;
  const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(layout.unknowns, layout.unknowns));

  // Each view's pull on all unknowns. (unknowns, views)
  Eigen::MatrixXd pull(layout.unknowns, std::ssize(normal.views()));
  for (std::size_t v = 0; v < normal.views().size(); ++v) {
    const ViewNormal& view = normal.views()[v];
    pull.col(static_cast<Eigen::Index>(v)) =
        inverse(Eigen::all, view.unknowns) * restored_gradient(view, inverse);
  }
  Uncertainty out;
  double of_noise = 0, of_views = 0;
  for (std::size_t c = 0; c < bundle.cameras.size(); ++c) {
    const Eigen::Index at = layout.camera(c), width = layout.camera_width;
    const Eigen::MatrixXd by_camera = pixels_by_camera(bundle.cameras[c], layout, volume_mm);
    const Eigen::MatrixXd covariance = sigma_px * sigma_px * inverse.block(at, at, width, width);
    out.cameras.push_back(sigma_of(bundle.cameras[c], covariance, layout, by_camera));
    of_noise += out.cameras.back().volume_px * out.cameras.back().volume_px;
    if (!volume_mm.empty())
      of_views +=
          (by_camera * pull.middleRows(at, width)).squaredNorm() / static_cast<double>(volume_mm.size());
  }
  if (of_noise > 0) out.clustering = std::max(1.0, std::sqrt(of_views / of_noise));
  for (CameraSigma& sigma : out.cameras) scale(sigma, out.clustering);
  if (layout.bow >= 0)
    out.bow_sigma_mm = out.clustering * sigma_px * inverse.diagonal().segment<2>(layout.bow).cwiseSqrt();
  return out;
}

}  // namespace flamefield
