#include "reconstruct/algebraic/row_table.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace flamefield {

namespace {

// Voxels go in consecutive pieces, so that each piece knows where its entries of a row begin.
constexpr std::size_t kPieces = 16;
constexpr double kMib = 1048576;

// visit(packed voxel, column) for the supported voxels of a piece, in plain order
template <class Visit>
void each_column(const Projector& projector, std::span<const std::uint8_t> support, std::size_t piece,
                 const Visit& visit) {
  const Grid& grid = projector.grid();
  const auto nx = static_cast<std::size_t>(grid.nx), ny = static_cast<std::size_t>(grid.ny);
  std::vector<ColumnEntry> column;
  const std::size_t end = grid.voxels() * (piece + 1) / kPieces;
  for (std::size_t voxel = grid.voxels() * piece / kPieces; voxel < end; ++voxel) {
    const std::size_t packed = projector.layout().voxel(
        static_cast<int>(voxel % nx), static_cast<int>(voxel / nx % ny), static_cast<int>(voxel / nx / ny));
    if (!support.empty() && !support[packed]) continue;
    projector.column(voxel, column);
    visit(packed, column);
  }
}

// From the columns of a sample of voxels.
double estimated_entries(const Projector& projector, Team& team) {
  const std::size_t voxels = projector.grid().voxels(), wanted = std::min<std::size_t>(voxels, 512);
  std::vector<double> entries(kPieces, 0);
  team.run(kPieces, [&](std::size_t piece) {
    std::vector<ColumnEntry> column;
    for (std::size_t i = piece; i < wanted; i += kPieces) {
      projector.column(i * voxels / wanted, column);
      entries[piece] += static_cast<double>(column.size());
    }
  });
  double sum = 0;
  for (double e : entries) sum += e;
  return sum / static_cast<double>(wanted) * static_cast<double>(voxels);
}

}  // namespace

Result<RowTable> RowTable::make(const Projector& projector, std::span<const std::uint8_t> support,
                                double budget_mib, Team& team) {
  const std::size_t pixels = projector.views() * static_cast<std::size_t>(projector.rows()) *
                             static_cast<std::size_t>(projector.cols());
  const auto refuse = [&](double needed_mib) {
    return invalid_input(concat("the rays of ", pixels, " pixels need about ", std::ceil(needed_mib), " MiB"),
                         concat("the budget is ", budget_mib, " MiB"),
                         "raise art.memory_budget_mib, bin the images, or use sart, which stores no rays");
  };
  const double bookkeeping_mib = static_cast<double>(pixels * (kPieces * 4 + 8)) / kMib;
  const double estimate_mib = bookkeeping_mib + estimated_entries(projector, team) * sizeof(Entry) / kMib;
  // The sample does not know the support, so only a gross excess is refused before counting.
  if (estimate_mib > (support.empty() ? 1.1 : 10) * budget_mib) return refuse(estimate_mib);

  // What each piece holds of each row, then where it begins.
  std::vector<std::vector<std::uint32_t>> place(kPieces, std::vector<std::uint32_t>(pixels, 0));
  team.run(kPieces, [&](std::size_t piece) {
    each_column(projector, support, piece, [&](std::size_t, const std::vector<ColumnEntry>& column) {
      for (const ColumnEntry& e : column) ++place[piece][e.pixel];
    });
  });
  RowTable out;
  out.start_.assign(pixels + 1, 0);
  for (std::size_t p = 0; p < pixels; ++p) {
    std::uint32_t count = 0;
    for (auto& of_piece : place) count += std::exchange(of_piece[p], count);
    out.start_[p + 1] = out.start_[p] + count;
  }
  const double needed_mib = bookkeeping_mib + static_cast<double>(out.start_[pixels]) * sizeof(Entry) / kMib;
  if (needed_mib > budget_mib) return refuse(needed_mib);
  out.entries_.resize(out.start_[pixels]);
  team.run(kPieces, [&](std::size_t piece) {
    each_column(projector, support, piece, [&](std::size_t voxel, const std::vector<ColumnEntry>& column) {
      for (const ColumnEntry& e : column)
        out.entries_[out.start_[e.pixel] + place[piece][e.pixel]++] = {static_cast<std::uint32_t>(voxel),
                                                                       e.weight};
    });
  });
  return out;
}

}  // namespace flamefield
