#include "reconstruct/evolutionary/operators.h"

#include <algorithm>

namespace flamefield {

namespace {

std::size_t draw(const Mask& mask, Stream& stream) {
  return mask[stream.below(mask.size())];
}

}  // namespace

void mutate(Editor& offspring, const Mask& mask, int intensity, double sigma, Stream& stream) {
  for (int i = 0; i < intensity; ++i) {
    const std::size_t voxel = draw(mask, stream);
    const Neighbours near = offspring.neighbours(voxel);
    const float mean = (offspring.value(voxel) + near.sum) / static_cast<float>(near.count + 1);
    offspring.set(voxel, static_cast<float>(stream.truncated_normal(std::clamp(mean, 0.0f, 1.0f), sigma)));
  }
}

void annihilate(Editor& offspring, const Mask& mask, int intensity, Stream& stream) {
  for (int i = 0; i < intensity; ++i) offspring.set(draw(mask, stream), 0);
}

void filter(Editor& offspring, const Mask& mask, int intensity, Stream& stream) {
  for (int i = 0; i < intensity; ++i) {
    const std::size_t voxel = draw(mask, stream);
    offspring.set(voxel, 0.5f * offspring.value(voxel) + offspring.neighbours(voxel).sum / 12);
  }
}

}  // namespace flamefield
