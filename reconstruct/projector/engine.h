#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "reconstruct/layout.h"
#include "reconstruct/parallel.h"

namespace flamefield {

struct ColumnEntry {
  std::uint32_t pixel = 0;  // index into (views, rows, cols), unpacked
  float weight = 0;         // mm
};

// One way to apply A to packed arrays (layout.h). `planes` are those that `volume` holds: A's other columns
// are left out. Only engines that can part the volume are given fewer than all.
class ProjectorEngine {
 public:
  virtual ~ProjectorEngine() = default;
  virtual void forward(Team& team, std::span<const std::size_t> views, const Planes& planes,
                       std::span<const float> volume, std::span<float> projections) const = 0;
  virtual void adjoint(Team& team, std::span<const std::size_t> views, std::span<const float> projections,
                       const Planes& planes, std::span<float> volume) const = 0;
  virtual void column(std::size_t voxel, std::vector<ColumnEntry>& entries) const = 0;
  virtual std::string name() const = 0;
};

}  // namespace flamefield
