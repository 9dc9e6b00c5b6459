#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "proto/rig.h"
#include "proto/volume.h"
#include "reconstruct/layout.h"
#include "reconstruct/parallel.h"
#include "reconstruct/projector/engine.h"
#include "reconstruct/share.h"

namespace flamefield {

struct ProjectorOptions {
  bool trilinear = false;        // the paper's ray tracer (Eq. 1) instead of the level-camera projector
  double f_number = 0;           // of the lens: blurs what is out of focus; 0: pinhole
  double focal_length_mm = 0;    // of the lens, needed with f_number
  double focus_distance_mm = 0;  // in focus; 0: the centre of the volume
  bool pixel_area = true;        // level: a pixel averages over its area; false: one central ray
  int pixel_samples = 2;         // trilinear: k x k rays a pixel
  double step_voxels = 0.5;      // trilinear: ds, in units of the smallest voxel side
  double memory_budget_mib =
      2048;  // trilinear: a matrix that needs more is not stored but traced anew each time
};

// A, the linear map from a volume to its projections, in mm: line integrals through any camera, lens
// distortion included. Volumes and projections are packed (layout()), so that solvers never convert. Forward,
// adjoint and columns come from one discretisation.
// Immutable; may be shared by solves and threads. With ranks, a volume is the planes that this process holds
// (share()), images are whole, and forward is called by all ranks together.
class Projector {
 public:
  // InvalidInput: invalid rig or grid, cameras of different image sizes, options out of range; with ranks,
  // more of them than can share the grid, or a rig that only a ray tracer can serve. `ranks` must outlive
  // this; null: the whole volume is held.
  static Result<Projector> make(const Rig& rig, const Grid& grid, const ProjectorOptions& options, Team& team,
                                Ranks* ranks = nullptr);

  const Grid& grid() const { return grid_; }        // of the planes held
  const Layout& layout() const { return layout_; }  // likewise
  const Share& share() const { return share_; }
  const std::vector<Camera>& cameras() const { return cameras_; }
  const std::vector<std::string>& view_names() const { return view_names_; }
  int rows() const { return layout_.rows; }
  int cols() const { return layout_.cols; }
  std::size_t views() const { return view_names_.size(); }
  std::string engine() const { return engine_->name(); }

  // projections = A volume
  void forward(Team& team, std::span<const float> volume, std::span<float> projections) const;
  // volume = A^T projections
  void adjoint(Team& team, std::span<const float> projections, std::span<float> volume) const;

  // The same with some views only: forward writes only those, adjoint reads only those.
  void forward(Team& team, std::span<const std::size_t> views, std::span<const float> volume,
               std::span<float> projections) const;
  void adjoint(Team& team, std::span<const std::size_t> views, std::span<const float> projections,
               std::span<float> volume) const;

  // A's column of one voxel, an index into (nz, ny, nx), unpacked; replaces `entries`.
  void column(std::size_t voxel, std::vector<ColumnEntry>& entries) const;

 private:
  explicit Projector(const Share& share) : grid_(share.grid()), share_(share) {}
  Grid grid_;
  Share share_;
  std::vector<Camera> cameras_;
  std::vector<std::string> view_names_;
  Layout layout_;
  std::vector<std::size_t> all_views_;
  std::shared_ptr<const ProjectorEngine> engine_;
};

}  // namespace flamefield
