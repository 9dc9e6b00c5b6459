#include "calibrate/robust.h"

#include <algorithm>
#include <cmath>

#include "calibrate/median.h"
#include "calibrate/start.h"

namespace flamefield {

namespace {

// Sigma of one coordinate from the median of all residuals: half of them may be wrong.
double robust_sigma_px(const Bundle& bundle) {
  std::vector<double> sizes;
  for (const BundleView& view : bundle.views) {
    for (const Eigen::Vector2d& r : residuals_px(bundle, view)) {
      if (!r.allFinite()) continue;  // not seen
      sizes.push_back(std::abs(r.x()));
      sizes.push_back(std::abs(r.y()));
    }
  }
  constexpr double kMedianOfHalfNormal = 0.6745;
  return std::max(1e-4, median(std::move(sizes)) / kMedianOfHalfNormal);
}

// Marks corners further off than `limit_px`; a view that loses half of them is wrong as a whole.
void reject_corners(Bundle& bundle, double limit_px) {
  for (BundleView& view : bundle.views) {
    std::size_t good = 0, seen = 0;
    const std::vector<Eigen::Vector2d> residuals = residuals_px(bundle, view);
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      view.used[i] = residuals[i].norm() <= limit_px;  // false where it was not seen
      good += view.used[i];
      seen += residuals[i].allFinite();
    }
    if (2 * good < seen) view.used.assign(view.used.size(), false);
  }
}

}  // namespace

BundleSummary solve_with_rejection(Bundle& bundle, BundleOptions& options, double reject_sigmas) {
  options.robust_px = 1;
  BundleSummary summary = solve_bundle(bundle, options);
  options.robust_px = 0;
  for (int round = 0; round < 2; ++round) {
    options.noise_px = robust_sigma_px(bundle);
    reject_corners(bundle, reject_sigmas * options.noise_px);
    const int before = summary.iterations;
    summary = solve_bundle(bundle, options);
    summary.iterations += before;
  }
  return summary;
}

bool hangs_together(const Bundle& bundle) {
  std::vector<Edge> edges;
  for (const BundleView& view : bundle.views) {
    if (std::ranges::find(view.used, true) != view.used.end()) edges.push_back({view.camera, view.pose, {}});
  }
  const Chain chain =
      chain_poses(edges, bundle.cameras.size(), bundle.world_from_board.size(), bundle.fixed_pose, Rigid3());
  return std::ranges::all_of(chain.camera_from_world, [](const auto& pose) { return pose.has_value(); });
}

std::optional<SplitHalf> split_half(const Bundle& whole, const BundleOptions& options,
                                    const MeasuringVolume& volume) {
  constexpr std::size_t kEnough = 10;  // poses: half of fewer cannot tell lenses from poses
  if (whole.world_from_board.size() < kEnough) return std::nullopt;
  Rig halves[2];
  for (std::size_t half = 0; half < 2; ++half) {
    Bundle bundle = whole;
    std::erase_if(bundle.views, [&](const BundleView& view) {
      return view.pose != whole.fixed_pose && view.pose % 2 != half;
    });
    if (!hangs_together(bundle)) return std::nullopt;
    solve_bundle(bundle, options);
    halves[half].cameras = bundle.cameras;
  }
  SplitHalf out;
  double rotation = 0, translation = 0;
  const double cameras = static_cast<double>(whole.cameras.size());
  for (std::size_t c = 0; c < whole.cameras.size(); ++c) {
    const Camera &a = halves[0].cameras[c], &b = halves[1].cameras[c];
    const double turn = rotation_angle_rad(a.camera_from_world * b.camera_from_world.inverse());
    rotation += turn * turn / cameras;
    translation += (a.centre_mm() - b.centre_mm()).squaredNorm() / cameras;
  }
  out.rotation_rad = std::sqrt(rotation);
  out.translation_mm = std::sqrt(translation);
  if (auto error = volume_error_px(halves[0], halves[1], volume)) out.volume = *error;
  return out;
}

}  // namespace flamefield
