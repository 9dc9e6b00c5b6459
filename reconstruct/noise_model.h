#pragma once

#include <span>
#include <vector>

#include "reconstruct/layout.h"
#include "reconstruct/settings.h"

namespace flamefield {

// What disturbs the images, in a scale in which the brightest pixel is 1: a pixel of value b has the variance
// sigma^2 + b / photons (recipe table [noise]; read and shot noise, Janesick, Photon Transfer, 2007).
struct NoiseModel {
  double sigma = 0;    // of a dark pixel, share of the brightest
  double photons = 0;  // at the brightest pixel; 0: no shot noise

  bool is_known() const { return sigma > 0 || photons > 0; }
  double variance(double value) const {
    return sigma * sigma + (photons > 0 && value > 0 ? value / photons : 0);
  }
};
std::vector<SettingField> fields_of(NoiseModel& noise);

// From the images alone (packed): second differences along both axes remove what varies smoothly (Immerkaer,
// Computer Vision and Image Understanding 64, 1996). Their median size is taken in classes of equal number by
// local brightness: a median forgets the few pixels at edges, and classes let the noise grow with the light.
// What is as fine as a pixel and as frequent as the median counts as noise. Empty for images narrower than
// three pixels.
struct NoiseClass {
  double brightness = 0, variance = 0;
};
std::vector<NoiseClass> noise_by_brightness(std::span<const float> images, const Layout& layout);

// Root mean square over all pixels of the noise.
double noise_level(std::span<const float> images, const Layout& layout);

// The two terms, as the line sigma^2 + b / photons through the classes, each counted by its own variance.
NoiseModel estimate_noise(std::span<const float> images, const Layout& layout);

// What discrete voxels and pixels leave unexplained even without noise, share of the brightest pixel: no
// misfit below it is worth having.
inline constexpr double kLeastNoise = 0.005;

// |noise| / |b| that the model expects; 0 for dark images. images: packed.
double expected_residual(const NoiseModel& noise, std::span<const float> images, const Layout& layout);

}  // namespace flamefield
