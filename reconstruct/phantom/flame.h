#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "reconstruct/phantom/front.h"
#include "reconstruct/phantom/phantom.h"

namespace flamefield {

// The mean shape of one front of a turbulent flame. r: distance from the axis, y: height, phi: azimuth; in
// box sides (Lattice).
struct MeanFront {
  std::function<double(double r, double y, double phi)> level;
  std::function<double(double y)> brightness;
  double thickness = 0.02;
};

struct FlameOptions {
  double wrinkling = 0.03;         // rms displacement of the fronts far above the rim, box sides
  double attached_below = 0.5;     // height at which the wrinkling is full grown
  double twist_rad = 0;            // of the wrinkles around the axis, per box side of height
  double extinction_level = -1.1;  // the sheet is dark where a random field of unit variance is below
};

// Wrinkles the mean fronts: the space in which they live is displaced by turbulence, so that sheets fold and
// pinch off as real ones do, and a second field extinguishes them locally.
Volume make_flame(const std::vector<MeanFront>& fronts, const FlameOptions& flame,
                  const PhantomOptions& options, const Grid& grid);

double smooth_step(double from, double to, double value);  // 0 below, 1 above, C1 between

// One file each.
Volume make_torus(const Grid& grid);
Volume make_hollow_sphere(const Grid& grid);
Volume make_gaussian(const Grid& grid);
Volume make_bunsen(const PhantomOptions& options, const Grid& grid);
Volume make_swirl(const PhantomOptions& options, const Grid& grid);
Volume make_stratified(const PhantomOptions& options, const Grid& grid);

}  // namespace flamefield
