#pragma once

#include "reconstruct/evolutionary/chromosome.h"
#include "reconstruct/evolutionary/mask.h"

namespace flamefield {

// The genetic operators of the paper, Section 2.2; each works at `intensity` voxels drawn from the mask.

// A value from a normal distribution cut off outside [0, 1], around the mean of the voxel and its neighbours.
void mutate(Editor& offspring, const Mask& mask, int intensity, double sigma, Stream& stream);

// Zero.
void annihilate(Editor& offspring, const Mask& mask, int intensity, Stream& stream);

// 1/2 of the voxel + 1/12 of its six neighbours (beyond the faces of the box there is nothing).
void filter(Editor& offspring, const Mask& mask, int intensity, Stream& stream);

}  // namespace flamefield
