#include <algorithm>
#include <cmath>

#include "reconstruct/random.h"
#include "reconstruct/render.h"

namespace flamefield {

Result<> add_noise(Projections& projections, const SensorNoise& noise) {
  if (!(noise.photons >= 0) || !(noise.read_noise >= 0) || !std::isfinite(noise.photons + noise.read_noise) ||
      noise.bits < 0 || noise.bits > 24) {
    return invalid_input(
        concat("photons=", noise.photons, ", read_noise=", noise.read_noise, ", bits=", noise.bits),
        "none may be negative, bits at most 24", "check the noise settings");
  }
  if (noise.read_noise > 0 && noise.photons == 0) {
    return invalid_input(concat("read_noise=", noise.read_noise, " without photons"),
                         "it counts in photons at the brightest pixel", "set --photons too");
  }
  if (projections.values.empty()) return {};
  const double brightest = *std::ranges::max_element(projections.values);
  if (!(brightest > 0)) return {};
  const double levels = noise.bits > 0 ? std::exp2(noise.bits) - 1 : 0;
  const double photons_per_unit = noise.photons / brightest;
  for (std::size_t i = 0; i < projections.values.size(); ++i) {
    Stream stream(noise.seed, i);
    double value = projections.values[i];
    if (noise.photons > 0) value = stream.poisson(value * photons_per_unit) / photons_per_unit;
    if (noise.read_noise > 0) value += noise.read_noise / photons_per_unit * stream.normal();
    if (levels > 0)
      value = std::clamp(std::round(value / brightest * levels), 0.0, levels) / levels * brightest;
    projections.values[i] = static_cast<float>(value);
  }
  return {};
}

}  // namespace flamefield
