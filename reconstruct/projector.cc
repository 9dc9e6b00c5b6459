#include "reconstruct/projector.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "proto/check.h"
#include "reconstruct/projector/level_engine.h"
#include "reconstruct/projector/ray_engine.h"
#include "reconstruct/projector/rectified_engine.h"
#include "reconstruct/projector/stored_matrix.h"

namespace flamefield {

namespace {

Result<> check(const Rig& rig, const Grid& grid, const ProjectorOptions& o) {
  if (auto ok = validate(rig); !ok) return ok;
  if (auto ok = validate(grid); !ok) return ok;
  if (o.pixel_samples < 1 || o.pixel_samples > 8 || !(o.step_voxels > 0) || !(o.step_voxels <= 1) ||
      !(o.memory_budget_mib >= 0)) {
    return invalid_input(concat("projector: pixel_samples=", o.pixel_samples, ", step_voxels=", o.step_voxels,
                                ", memory_budget_mib=", o.memory_budget_mib),
                         "ranges are 1..8, (0, 1] and >= 0", "check table [projector] of the recipe");
  }
  const Camera& first = rig.cameras.front();
  double pixels = 0;
  for (const Camera& c : rig.cameras) {
    if (c.image_width_px != first.image_width_px || c.image_height_px != first.image_height_px) {
      return invalid_input(
          concat("camera ", c.name, " has ", c.image_width_px, "x", c.image_height_px, " px, camera ",
                 first.name, " ", first.image_width_px, "x", first.image_height_px),
          "projections share one size", "crop the cameras to one size, e.g. with prepare");
    }
    pixels += static_cast<double>(c.image_width_px) * c.image_height_px;
  }
  if (pixels >= 4294967296.0 || static_cast<double>(grid.voxels()) >= 4294967296.0) {
    return invalid_input(concat(pixels, " pixels, ", grid.voxels(), " voxels"),
                         "fewer than 2^32 of each are supported", "bin the images or use larger voxels");
  }
  return {};
}

// The level projector, directly or behind a rectification; none when the cameras do not allow either.
std::shared_ptr<const ProjectorEngine> fast_engine(const Rig& rig, const Grid& grid, const Layout& layout,
                                                   const ProjectorOptions& options) {
  const PixelModel model{.area = options.pixel_area};
  if (std::ranges::all_of(rig.cameras, [](const Camera& c) { return is_level(c); })) {
    std::vector<LevelView> views;
    for (const Camera& c : rig.cameras) views.emplace_back(c, grid, model);
    if (!LevelEngine::obstacle(views).empty()) return nullptr;
    return std::make_shared<LevelEngine>(std::move(views), layout);
  }
  if (!RectifiedEngine::obstacle(rig, grid, model).empty()) return nullptr;
  return std::make_shared<RectifiedEngine>(rig, grid, layout, model);
}

}  // namespace

Result<Projector> Projector::make(const Rig& rig, const Grid& grid, const ProjectorOptions& options,
                                  Team& team) {
  if (auto ok = check(rig, grid, options); !ok) return tl::unexpected(ok.error());
  Projector out;
  out.grid_ = grid;
  out.layout_ = Layout(grid, static_cast<int>(rig.cameras.size()), rig.cameras.front().image_height_px,
                       rig.cameras.front().image_width_px);
  out.cameras_ = rig.cameras;
  for (const Camera& c : rig.cameras) out.view_names_.push_back(c.name);
  out.all_views_.resize(out.views());
  std::iota(out.all_views_.begin(), out.all_views_.end(), std::size_t{0});
  if (!options.trilinear) {
    if ((out.engine_ = fast_engine(rig, grid, out.layout_, options))) return out;
  }
  const double budget_bytes = options.memory_budget_mib * 1048576;
  if (StoredMatrix::estimated_bytes(rig, grid, options, team) <= budget_bytes) {
    out.engine_ = std::make_shared<StoredMatrix>(rig, grid, out.layout_, options, team);
  } else {
    out.engine_ = std::make_shared<RayEngine>(rig, grid, out.layout_, options);
  }
  return out;
}

void Projector::forward(Team& team, std::span<const float> volume, std::span<float> projections) const {
  forward(team, all_views_, volume, projections);
}
void Projector::adjoint(Team& team, std::span<const float> projections, std::span<float> volume) const {
  adjoint(team, all_views_, projections, volume);
}
void Projector::forward(Team& team, std::span<const std::size_t> views, std::span<const float> volume,
                        std::span<float> projections) const {
  expect(volume.size() == layout_.voxels() && projections.size() == layout_.pixels(),
         "shapes match the projector");
  engine_->forward(team, views, volume, projections);
}
void Projector::adjoint(Team& team, std::span<const std::size_t> views, std::span<const float> projections,
                        std::span<float> volume) const {
  expect(volume.size() == layout_.voxels() && projections.size() == layout_.pixels(),
         "shapes match the projector");
  engine_->adjoint(team, views, projections, volume);
}
void Projector::column(std::size_t voxel, std::vector<ColumnEntry>& entries) const {
  expect(voxel < grid_.voxels(), "the voxel is in the grid");
  entries.clear();
  engine_->column(voxel, entries);
}

}  // namespace flamefield
