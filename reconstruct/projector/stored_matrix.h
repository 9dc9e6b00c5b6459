#pragma once

#include "reconstruct/projector.h"

namespace flamefield {

// A as one compressed-column matrix a view: a column of a view is a handful of neighbouring pixels, and the
// image it goes to stays in the first-level cache. Forward runs views in parallel, the adjoint voxels.
class StoredMatrix : public ProjectorEngine {
 public:
  StoredMatrix(const Rig& rig, const Grid& grid, const Layout& layout, const ProjectorOptions& options,
               Team& team);

  // From tracing one pixel in 67.
  static double estimated_bytes(const Rig& rig, const Grid& grid, const ProjectorOptions& options,
                                Team& team);

  void forward(Team& team, std::span<const std::size_t> views, const Planes& planes,
               std::span<const float> volume, std::span<float> projections) const override;
  void adjoint(Team& team, std::span<const std::size_t> views, std::span<const float> projections,
               const Planes& planes, std::span<float> volume) const override;
  void column(std::size_t voxel, std::vector<ColumnEntry>& entries) const override;
  std::string name() const override;

 private:
  struct View {
    std::vector<std::uint32_t> start;  // (packed voxels + 1), into the two below
    std::vector<std::uint32_t> pixel;  // packed, in the view
    std::vector<float> weight;         // mm
  };
  std::vector<View> views_;
  Grid grid_;
  Layout layout_;
};

}  // namespace flamefield
