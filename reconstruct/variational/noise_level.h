#pragma once

#include <span>

#include "reconstruct/layout.h"

namespace flamefield {

// rms over all pixels of the noise in images (packed), from the images alone. Second differences along both
// axes remove what varies smoothly (Immerkaer, Computer Vision and Image Understanding 64, 1996). Their
// median size is taken in eight classes of equal number by local brightness: a median forgets the few pixels
// at edges, and classes let the noise grow with the light. What is as fine as a pixel and as frequent as the
// median counts as noise. 0 for images narrower than three pixels.
double noise_level(std::span<const float> images, const Layout& layout);

}  // namespace flamefield
