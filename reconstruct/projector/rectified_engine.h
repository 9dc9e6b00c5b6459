#pragma once

#include <memory>
#include <vector>

#include "proto/rig.h"
#include "reconstruct/layout.h"
#include "reconstruct/projector/level_engine.h"

namespace flamefield {

// The level pinhole that stands where a camera stands and looks the same way, turned upright, without
// distortion; its image holds the whole box. Its pixels are 1 / `oversampling` as wide as the camera's.
Camera level_twin(const Camera& camera, const Grid& grid, double oversampling);

// A for tilted and distorted cameras: the level projector onto each camera's level twin, then cubic
// convolution (Keys, IEEE Trans. ASSP 29, 1981) from the twin's image at the camera's pixels. The twin's
// pixels average over as much as the camera's do, so that interpolation adds no blur of its own. The adjoint
// is the exact transpose.
class RectifiedEngine : public ProjectorEngine {
 public:
  // Why these cameras cannot be served; empty when they can.
  static std::string obstacle(const Rig& rig, const Grid& grid, const std::vector<PixelModel>& models);

  RectifiedEngine(const Rig& rig, const Grid& grid, const Layout& layout,
                  const std::vector<PixelModel>& models);

  void forward(Team& team, std::span<const std::size_t> views, const Planes& planes,
               std::span<const float> volume, std::span<float> projections) const override;
  void adjoint(Team& team, std::span<const std::size_t> views, std::span<const float> projections,
               const Planes& planes, std::span<float> volume) const override;
  void column(std::size_t voxel, std::vector<ColumnEntry>& entries) const override;
  std::string name() const override { return "rectified " + twins_->name(); }

 private:
  // Where a pixel of the camera falls in the twin's image.
  struct Sample {
    std::int32_t corner =
        -1;                   // lowest of the 4 x 4 pixels it is interpolated from, within the view; -1: none
    float right = 0, up = 0;  // fractions beyond the second pixel of the four
  };
  Sample sample_of(std::size_t view, int row, int col) const;

  std::vector<Camera> cameras_, twin_cameras_;
  Layout layout_, twin_layout_;
  std::unique_ptr<LevelEngine> twins_;
  std::vector<Sample> samples_;  // of every pixel, packed
};

}  // namespace flamefield
