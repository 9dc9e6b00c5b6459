#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace flamefield {

// A packed volume that begins on a cache line, with a vector of zeros before and after, so that kernels may
// look one voxel beyond either end of any column.
class GuardedVolume {
 public:
  explicit GuardedVolume(std::size_t voxels) : size_(voxels), values_(voxels + 3 * kGuard, 0.0f) {
    const auto address = reinterpret_cast<std::uintptr_t>(values_.data() + kGuard) / sizeof(float);
    begin_ = kGuard + (kGuard - address % kGuard) % kGuard;
  }
  GuardedVolume(GuardedVolume&&) = default;  // the values stay where they are
  GuardedVolume& operator=(GuardedVolume&&) = default;
  GuardedVolume(const GuardedVolume&) = delete;
  GuardedVolume& operator=(const GuardedVolume&) = delete;

  float* data() { return values_.data() + begin_; }
  const float* data() const { return values_.data() + begin_; }
  std::span<float> span() { return {data(), size_}; }
  std::span<const float> span() const { return {data(), size_}; }

 private:
  static constexpr std::size_t kGuard = 16;
  std::size_t size_, begin_;
  std::vector<float> values_;
};

}  // namespace flamefield
