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

  void forward(Team& team, std::span<const std::size_t> views, const Planes& planes,
               std::span<const float> volume, std::span<float> projections) const override;
  void adjoint(Team& team, std::span<const std::size_t> views, std::span<const float> projections,
               const Planes& planes, std::span<float> volume) const override;
  void column(std::size_t voxel, std::vector<ColumnEntry>& entries) const override;
  std::string name() const override;

 private:
  // The volume as seen along a main direction: planes of voxel columns, in slabs of planes and, within a
  // slab, tiles of neighbouring voxel columns that stay in cache while all views pass.
  // What is not held of the volume lies outside `planes`, or outside the shape's begin .. end.
  struct Walk {
    bool along_z;
    LevelView::Run planes;
    std::size_t plane_stride;  // floats from plane to plane
    StripShape shape;          // but for what depends on the view
    int slab, tile;            // planes; voxel columns
    int patch;                 // planes of a patch
    bool is_parted;            // not all of the volume is held
    std::size_t before;        // floats of the volume before what is held

    StripShape seen_by(const LevelView& view) const;
    int others() const { return shape.end - shape.begin; }
    int tiles() const { return (others() + tile - 1) / tile; }
  };
  Walk walk(bool along_z, const Planes& held, std::size_t patch_floats, int slab) const;
  StripPatch patch(const Walk& w, std::size_t view, int col, int cols, int plane, int planes,
                   LevelView::Strips& strips) const;
  template <class Visit>
  static void each_patch(const Walk& w, LevelView::Run cols, LevelView::Run planes, const Visit& visit);
  void add_pixel_columns(const Walk& w, std::size_t view, LevelView::Run cols, LevelView::Run planes,
                         std::span<const float> volume, std::span<const std::uint8_t> lit,
                         std::span<float> projections) const;
  void add_tile(const Walk& w, std::size_t view, LevelView::Run planes, LevelView::Run tile,
                std::span<const float> weighted, std::span<float> volume) const;
  std::size_t line(std::size_t view, int col) const {
    return layout_.pixel(static_cast<int>(view), layout_.rows - 1, col);
  }

  std::vector<LevelView> views_;
  Layout layout_;
  bool vectors_ = true;         // the vector kernels can serve all views
  std::vector<float> lengths_;  // mm of line of sight between planes, packed; zero in the padding
};

}  // namespace flamefield
