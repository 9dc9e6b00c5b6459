#pragma once

#include "reconstruct/projector.h"
#include "reconstruct/projector/ray_march.h"

namespace flamefield {

// A traced anew at every use: for problems whose matrix does not fit into memory. Forward runs image rows in
// parallel; the adjoint slabs of planes, each of which takes from every ray what falls into it.
class RayEngine : public ProjectorEngine {
 public:
  RayEngine(const Rig& rig, const Grid& grid, const Layout& layout, const ProjectorOptions& options);

  void forward(Team& team, std::span<const std::size_t> views, const Planes& planes,
               std::span<const float> volume, std::span<float> projections) const override;
  void adjoint(Team& team, std::span<const std::size_t> views, std::span<const float> projections,
               const Planes& planes, std::span<float> volume) const override;
  void column(std::size_t voxel, std::vector<ColumnEntry>& entries) const override;
  std::string name() const override { return "traced"; }

 private:
  std::vector<MarchedRay> rays_of(Team& team, std::size_t view) const;  // (cols, line, sub-pixels)
  void gather_slab(const std::vector<MarchedRay>& rays, std::span<const float> image, int from_z, int to_z,
                   std::span<float> volume) const;
  float weight_of(const MarchedRay& ray, const std::array<int, 3>& voxel) const;

  Rig rig_;
  Grid grid_;
  Layout layout_;
  int pixel_samples_;
  double step_mm_;
};

}  // namespace flamefield
