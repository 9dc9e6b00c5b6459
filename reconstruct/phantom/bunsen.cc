#include <cmath>

#include "reconstruct/phantom/flame.h"

namespace flamefield {

// A premixed jet flame: one cone that closes at its tip (paper, Section 3.3; 50 x 60 x 50 voxels, 23 views).
Volume make_bunsen(const PhantomOptions& options, const Grid& grid) {
  const Eigen::Vector3d box = grid.upper_mm() - grid.lower_mm();
  const double height = box.y() / box.x(), tip = 0.8 * height, rim = 0.25;
  const double slant = tip / std::hypot(tip, rim);  // from radial distance to distance from the cone
  const MeanFront cone = {
      .level = [=](double r, double y, double) { return (r - rim * (1 - y / tip)) * slant; },
      .brightness = [=](double y) { return smooth_step(0.02 * height, 0.08 * height, y); },
      .thickness = 0.020};
  return make_flame({cone}, {.wrinkling = 0.03, .attached_below = 0.6 * height, .extinction_level = -1.6},
                    options, grid);
}

}  // namespace flamefield
