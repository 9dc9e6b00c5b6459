#include "reconstruct/evolutionary/column_table.h"

#include <algorithm>
#include <numeric>

namespace flamefield {

ColumnTable::ColumnTable(const Projector& projector, double budget_mib, Team& team) : projector_(projector) {
  constexpr std::size_t kGrain = 1024;
  const std::size_t voxels = projector.grid().voxels(), blocks = (voxels + kGrain - 1) / kGrain;
  // The middle of the box is seen by most pixels: were all voxels like those, would they fit?
  std::vector<ColumnEntry> middle;
  const Grid& g = projector.grid();
  projector.column(g.index(g.nx / 2, g.ny / 2, g.nz / 2), middle);
  const double needed_mib = static_cast<double>(voxels) *
                            static_cast<double>(middle.size() * sizeof(ColumnEntry) + sizeof(std::size_t)) /
                            1048576;
  if (needed_mib > budget_mib) return;

  std::vector<std::vector<ColumnEntry>> parts(blocks);
  std::vector<std::size_t> sizes(voxels + 1, 0);
  team.run_ranges(voxels, kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<ColumnEntry> column;
    std::vector<ColumnEntry>& part = parts[begin / kGrain];
    for (std::size_t voxel = begin; voxel < end; ++voxel) {
      projector.column(voxel, column);
      part.insert(part.end(), column.begin(), column.end());
      sizes[voxel + 1] = column.size();
    }
  });
  std::partial_sum(sizes.begin(), sizes.end(), sizes.begin());
  start_ = std::move(sizes);
  entries_.reserve(start_.back());
  for (std::vector<ColumnEntry>& part : parts) {
    entries_.insert(entries_.end(), part.begin(), part.end());
    part = {};
  }
}

std::span<const ColumnEntry> ColumnTable::of(std::size_t voxel, std::vector<ColumnEntry>& scratch) const {
  if (is_stored()) return std::span(entries_).subspan(start_[voxel], start_[voxel + 1] - start_[voxel]);
  projector_.column(voxel, scratch);
  return scratch;
}

}  // namespace flamefield
