#include "reconstruct/phantom/turbulence.h"

#include <cmath>
#include <complex>
#include <numbers>

#include "reconstruct/random.h"

namespace flamefield {

namespace {

struct Mode {
  std::array<double, 3> wave = {};  // rad per box side
  double phase = 0;                 // at this time
  std::array<float, 3> amplitude = {};
};

std::vector<Mode> draw_modes(const TurbulenceOptions& o) {
  std::vector<Mode> modes(static_cast<std::size_t>(o.modes));
  double power = 0;
  for (std::size_t i = 0; i < modes.size(); ++i) {
    Stream stream(o.seed, i);
    // Wavelengths are spread evenly over the octaves, without the clusters of chance.
    const double fraction = (static_cast<double>(i) + stream.uniform()) / o.modes;
    const double scale = std::pow(o.shortest / o.longest, fraction);  // wavelength / longest
    const double k = 2 * std::numbers::pi / (o.longest * scale);
    const double c = 2 * stream.uniform() - 1, s = std::sqrt(1 - c * c),
                 phi = 2 * std::numbers::pi * stream.uniform();
    modes[i].wave = {k * s * std::cos(phi), k * c, k * s * std::sin(phi)};
    const double turning =
        2 * std::numbers::pi * o.turnover_per_s * std::pow(scale, -2.0 / 3.0) * stream.normal();
    modes[i].phase =
        2 * std::numbers::pi * stream.uniform() + (turning - modes[i].wave[1] * o.rise_per_s) * o.time_s;
    for (float& a : modes[i].amplitude) {
      a = static_cast<float>(std::pow(scale, 4.0 / 3.0) * stream.normal());
      power += 0.5 * a * a;
    }
  }
  const auto scale = static_cast<float>(o.rms / std::sqrt(power / 3));
  for (Mode& mode : modes)
    for (float& a : mode.amplitude) a *= scale;
  return modes;
}

}  // namespace

VectorField turbulence(const TurbulenceOptions& options, const Lattice& lattice, Team& team) {
  const std::vector<Mode> modes = draw_modes(options);
  const auto nx = static_cast<std::size_t>(lattice.nodes[0]);
  // exp(i k.q) = exp(i kx x) exp(i (ky y + kz z)): one table along x, one factor a row.
  std::vector<float> cosine(modes.size() * nx), sine(modes.size() * nx);
  for (std::size_t m = 0; m < modes.size(); ++m)
    for (std::size_t x = 0; x < nx; ++x) {
      const double angle = modes[m].wave[0] * lattice.coordinate(0, static_cast<int>(x));
      cosine[m * nx + x] = static_cast<float>(std::cos(angle));
      sine[m * nx + x] = static_cast<float>(std::sin(angle));
    }
  VectorField field;
  for (auto& component : field) component.assign(lattice.size(), 0);
  team.run(static_cast<std::size_t>(lattice.nodes[2]), [&](std::size_t z) {
    std::vector<float> wave(nx);
    for (int y = 0; y < lattice.nodes[1]; ++y) {
      const std::size_t row = lattice.index(0, y, static_cast<int>(z));
      for (std::size_t m = 0; m < modes.size(); ++m) {
        const double angle = modes[m].phase + modes[m].wave[1] * lattice.coordinate(1, y) +
                             modes[m].wave[2] * lattice.coordinate(2, static_cast<int>(z));
        const auto c = static_cast<float>(std::cos(angle)), s = static_cast<float>(std::sin(angle));
        const float *cx = &cosine[m * nx], *sx = &sine[m * nx];
        for (std::size_t x = 0; x < nx; ++x) wave[x] = c * cx[x] - s * sx[x];
        for (std::size_t a = 0; a < 3; ++a) {
          float* out = &field[a][row];
          const float amplitude = modes[m].amplitude[a];
          for (std::size_t x = 0; x < nx; ++x) out[x] += amplitude * wave[x];
        }
      }
    }
  });
  return field;
}

}  // namespace flamefield
