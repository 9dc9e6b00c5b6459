#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "reconstruct/projector.h"

namespace flamefield {

// Columns of A for a solver that changes single voxels: stored if all of them fit the budget, else worked out
// anew at every use. The same weights either way.
class ColumnTable {
 public:
  ColumnTable(const Projector& projector, double budget_mib, Team& team);

  const Grid& grid() const { return projector_.grid(); }
  bool is_stored() const { return !start_.empty(); }

  // Entries of one voxel, an index into (nz, ny, nx); pixels are indices into (views, rows, cols). They may
  // live in `scratch`.
  std::span<const ColumnEntry> of(std::size_t voxel, std::vector<ColumnEntry>& scratch) const;

 private:
  const Projector& projector_;
  std::vector<std::size_t> start_;  // (voxels + 1)
  std::vector<ColumnEntry> entries_;
};

}  // namespace flamefield
