#include "reconstruct/phantom/flame.h"

namespace flamefield {

// Two annular streams around a bluff body: an inner sheet behind the body, an outer one towards the co-flow,
// hollow on the axis (paper, Section 3.5; 52 x 55 x 52 voxels of 1.32 mm, 15 views).
Volume make_stratified(const PhantomOptions& options, const Grid& grid) {
  const Eigen::Vector3d box = grid.upper_mm() - grid.lower_mm();
  const double height = box.y() / box.x();
  const MeanFront inner = {
      .level = [](double r, double y, double) { return 0.10 + 0.07 * y - r; },
      .brightness = [=](double y) { return 0.85 * smooth_step(0.0, 0.08, y) * (1 - 0.4 * y / height); },
      .thickness = 0.019};
  const MeanFront outer = {.level = [](double r, double y, double) { return r - (0.19 + 0.15 * y); },
                           .brightness = [](double y) { return smooth_step(0.0, 0.08, y); },
                           .thickness = 0.019};
  return make_flame({inner, outer}, {.wrinkling = 0.03, .attached_below = 0.7, .extinction_level = -1.1},
                    options, grid);
}

}  // namespace flamefield
