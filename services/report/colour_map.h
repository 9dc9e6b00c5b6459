#pragma once

#include <array>
#include <cstdint>

namespace flamefield {

using Rgb = std::array<std::uint8_t, 3>;

// 256 colours from low to high. Both maps are perceptually even and safe for colour-blind readers.
using ColourMap = std::array<Rgb, 256>;

// For emission: black - purple - orange - pale yellow (matplotlib's inferno).
const ColourMap& inferno();

// For differences: blue - white - red, zero in the middle (Moreland 2009, "Diverging Color Maps for
// Scientific Visualization", smooth interpolation in Msh space).
const ColourMap& cool_warm();

// The colour of a value in [low, high]; beyond the ends the end colours. NaN is mid grey.
Rgb colour_of(const ColourMap& map, double value, double low, double high);

}  // namespace flamefield
