#include <cmath>
#include <numbers>

#include "reconstruct/phantom/flame.h"

namespace flamefield {

// A swirl-stabilised flame: two V-shaped sheets, inside and outside of the annular jet, wound by a precessing
// helix (paper, Section 3.4; 66 x 43 x 66 voxels, 24 views).
Volume make_swirl(const PhantomOptions& options, const Grid& grid) {
  const Eigen::Vector3d box = grid.upper_mm() - grid.lower_mm();
  const double height = box.y() / box.x();
  constexpr double kTurnsPerSecond = 1.0;
  const auto helix = [=, t = options.time_s](double y, double phi) {
    const double angle = phi - 2 * std::numbers::pi * (1.2 * y - kTurnsPerSecond * t);
    const double grown = smooth_step(0, 0.4, y);
    return grown * (0.025 * std::cos(angle) + 0.015 * std::cos(2 * angle + 1));
  };
  const MeanFront inner = {
      .level = [=](double r, double y, double phi) { return 0.06 + 0.32 * y + helix(y, phi) - r; },
      .brightness = [=](double y) { return smooth_step(0.0, 0.06, y) * (1 - 0.5 * y / height); },
      .thickness = 0.018};
  const MeanFront outer = {
      .level = [=](double r, double y, double phi) { return r - (0.14 + 0.36 * y + helix(y, phi)); },
      .brightness = [=](double y) { return 0.8 * smooth_step(0.0, 0.06, y) * (1 - 0.8 * y / height); },
      .thickness = 0.018};
  return make_flame({inner, outer},
                    {.wrinkling = 0.028, .attached_below = 0.35, .twist_rad = 2.0, .extinction_level = -1.0},
                    options, grid);
}

}  // namespace flamefield
