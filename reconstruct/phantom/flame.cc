#include "reconstruct/phantom/flame.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/phantom/turbulence.h"

namespace flamefield {

double smooth_step(double from, double to, double value) {
  const double t = std::clamp((value - from) / (to - from), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

Volume make_flame(const std::vector<MeanFront>& fronts, const FlameOptions& flame,
                  const PhantomOptions& options, const Grid& grid) {
  Team team;
  const Lattice lattice = lattice_for(grid);
  const std::uint64_t seed = options.seed * 16 + static_cast<std::uint64_t>(options.kind) * 2;
  const VectorField shift =
      turbulence({.seed = seed, .time_s = options.time_s, .rms = flame.wrinkling}, lattice, team);
  const VectorField strain = turbulence(
      {.seed = seed + 1, .time_s = options.time_s, .longest = 0.5, .shortest = 0.12, .rms = 1, .modes = 24},
      lattice, team);

  std::vector<Front> painted(fronts.size());
  for (std::size_t f = 0; f < fronts.size(); ++f) {
    painted[f].level.resize(lattice.size());
    painted[f].brightness.resize(lattice.size());
    painted[f].thickness = static_cast<float>(fronts[f].thickness);
  }
  team.run(static_cast<std::size_t>(lattice.nodes[2]), [&](std::size_t plane) {
    const int z = static_cast<int>(plane);
    for (int y = 0; y < lattice.nodes[1]; ++y) {
      const double height = lattice.coordinate(1, y);
      const double grown = smooth_step(-0.05, flame.attached_below, height);
      const double turn = flame.twist_rad * height;
      const double c = std::cos(turn), s = std::sin(turn);
      for (int x = 0; x < lattice.nodes[0]; ++x) {
        const std::size_t i = lattice.index(x, y, z);
        // A swirling flow carries its wrinkles around the axis: their displacement turns with height.
        const double u = grown * (c * shift[0][i] - s * shift[2][i]),
                     w = grown * (s * shift[0][i] + c * shift[2][i]);
        const double px = lattice.coordinate(0, x) + u, pz = lattice.coordinate(2, z) + w;
        const double py = height + 0.6 * grown * shift[1][i];
        const double r = std::hypot(px, pz), phi = std::atan2(pz, px);
        for (std::size_t f = 0; f < fronts.size(); ++f) {
          const double e = strain[f % 3][i];
          const double lit = smooth_step(flame.extinction_level - 0.3, flame.extinction_level + 0.3, e);
          painted[f].level[i] = static_cast<float>(fronts[f].level(r, py, phi));
          painted[f].brightness[i] =
              static_cast<float>(fronts[f].brightness(height) * lit * (0.75 + 0.25 * std::tanh(e)));
        }
      }
    }
  });
  return paint(painted, lattice, grid, team);
}

}  // namespace flamefield
