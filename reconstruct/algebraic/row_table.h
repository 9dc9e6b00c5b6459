#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/error.h"
#include "reconstruct/parallel.h"
#include "reconstruct/projector.h"

namespace flamefield {

// The rows of A, one a ray, for solvers that take rays one by one: the transpose of Projector::column of all
// voxels. Voxels outside the support are left out.
class RowTable {
 public:
  struct Entry {
    std::uint32_t voxel;  // packed
    float weight;         // mm
  };

  // InvalidInput when it would need more than `budget_mib`.
  static Result<RowTable> make(const Projector& projector, std::span<const std::uint8_t> support,
                               double budget_mib, Team& team);

  std::size_t rows() const { return start_.size() - 1; }
  // pixel: index into (views, rows, cols), unpacked. Sorted by plain voxel.
  std::span<const Entry> row(std::size_t pixel) const {
    return std::span(entries_).subspan(start_[pixel], start_[pixel + 1] - start_[pixel]);
  }
  std::size_t entries() const { return entries_.size(); }

 private:
  std::vector<std::uint64_t> start_;  // (pixels + 1), into entries_
  std::vector<Entry> entries_;
};

}  // namespace flamefield
