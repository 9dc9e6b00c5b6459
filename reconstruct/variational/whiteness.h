#pragma once

#include <span>

#include "reconstruct/layout.h"
#include "reconstruct/parallel.h"

namespace flamefield {

struct ResidualSize {
  double rms = 0;       // over all pixels
  double fine_rms = 0;  // of the noise that the finest detail of the residual hints at; equal for white noise
};

// The size of residual images a - b (packed), and what it would be if all of it were as rough as its finest
// detail: second differences along both axes (Immerkaer, Computer Vision and Image Understanding 64, 1996),
// on all pixels with eight neighbours. Images narrower than three pixels have no fine detail.
ResidualSize residual_size(std::span<const float> a, std::span<const float> b, const Layout& layout,
                           Team& team);

}  // namespace flamefield
