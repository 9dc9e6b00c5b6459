#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/rig.h"
#include "proto/volume.h"
#include "reconstruct/evolutionary/strip_table.h"
#include "reconstruct/projector.h"
#include "reconstruct/random.h"

namespace flamefield {

// The stochastic mask (paper, Section 2.3): voxels drawn by a Metropolis chain, at which operators work. A
// voxel appears as often as the target density says.
using Mask = std::vector<std::uint32_t>;

// Stage one (Algorithm 3): the images are the prior. A candidate is accepted when the same random number
// passes in every view; a camera that does not see one of the two voxels abstains. images: (views, rows,
// cols); negative pixels count as dark.
Mask mask_from_images(const Projector& projector, std::span<const float> images, std::size_t samples,
                      Stream& stream);

// What all views agree on: of the mean intensities that a voxel's columns see, view by view, the least. Zero
// where one is below kDarkest, or where no view looks. images: packed, brightest pixel 1. (nz, ny, nx)
inline constexpr float kDarkest = 5e-4f;
std::vector<float> consensus_density(const StripTable& strips, const Layout& layout,
                                     std::span<const float> images, Team& team);

// Stage two (Algorithm 4): the density is a field of the best chromosome.
Mask mask_from_field(std::span<const float> density, std::size_t samples, Stream& stream);

// Length of the gradient by central differences (one-sided at the faces), field unit per voxel.
std::vector<float> gradient_magnitude(std::span<const float> field, const Grid& grid);

}  // namespace flamefield
