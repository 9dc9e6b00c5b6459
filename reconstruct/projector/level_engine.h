#pragma once

#include <vector>

#include "reconstruct/layout.h"
#include "reconstruct/projector/engine.h"
#include "reconstruct/projector/level_view.h"

namespace flamefield {

// A for level cameras: on every plane of voxels across a pixel column's main direction, blend neighbouring
// voxel columns and resample the blend onto the pixel column (Joseph's method, IEEE Trans. Med. Imaging 1,
// 1982, with pixels of finite size, factorised). Forward owns pixel columns, the adjoint planes of voxels;
// neither needs atomics. Slabs of planes with the views inside keep the working set in cache.
class LevelEngine : public ProjectorEngine {
 public:
  // Why the factorisation cannot serve these views; empty when it can.
  static std::string obstacle(const std::vector<LevelView>& views);

  LevelEngine(std::vector<LevelView> views, const Layout& layout);

  void forward(Team& team, std::span<const std::size_t> views, std::span<const float> volume,
               std::span<float> projections) const override;
  void adjoint(Team& team, std::span<const std::size_t> views, std::span<const float> projections,
               std::span<float> volume) const override;
  void column(std::size_t voxel, std::vector<ColumnEntry>& entries) const override;
  std::string name() const override;

 private:
  // The volume as seen along a main direction: planes of voxel columns.
  struct Walk {
    bool along_z;
    int planes;
    std::size_t plane_stride;  // floats from plane to plane
    StripShape shape;          // but for what depends on the view
    StripShape seen_by(const LevelView& view) const;
  };
  Walk walk(bool along_z) const;
  std::size_t line(std::size_t view, int col) const {
    return layout_.pixel(static_cast<int>(view), layout_.rows - 1, col);
  }

  std::vector<LevelView> views_;
  Layout layout_;
  bool vectors_ = true;         // the vector kernels can serve all views
  std::vector<float> lengths_;  // mm of line of sight between planes, packed; zero in the padding
};

}  // namespace flamefield
