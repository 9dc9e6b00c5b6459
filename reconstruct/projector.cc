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

Result<> check(const Rig& rig, const Grid& grid, const ProjectorOptions& o, bool is_shared) {
  if (auto ok = validate(rig); !ok) return ok;
  if (auto ok = validate(grid); !ok) return ok;
  if (o.pixel_samples < 1 || o.pixel_samples > 8 || !(o.step_voxels > 0) || !(o.step_voxels <= 1) ||
      !(o.memory_budget_mib >= 0)) {
    return invalid_input(concat("projector: pixel_samples=", o.pixel_samples, ", step_voxels=", o.step_voxels,
                                ", memory_budget_mib=", o.memory_budget_mib),
                         "ranges are 1..8, (0, 1] and >= 0", "check table [projector] of the recipe");
  }
  if (!(o.f_number >= 0) || !(o.focus_distance_mm >= 0) || (o.f_number > 0 && !(o.focal_length_mm > 0))) {
    return invalid_input(concat("projector: f_number=", o.f_number, ", focal_length_mm=", o.focal_length_mm,
                                ", focus_distance_mm=", o.focus_distance_mm),
                         "an aperture needs the focal length of its lens, and none may be negative",
                         "set projector.focal_length_mm, or f_number=0 for a pinhole");
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
  if (pixels >= 4294967296.0 || (!is_shared && static_cast<double>(grid.voxels()) >= 4294967296.0)) {
    return invalid_input(concat(pixels, " pixels, ", grid.voxels(), " voxels"),
                         "fewer than 2^32 of each are supported", "bin the images or use larger voxels");
  }
  return {};
}

Lens lens_of(const Camera& camera, const Grid& grid, const ProjectorOptions& options) {
  if (options.f_number <= 0) return {};
  const Eigen::Vector3d centre = 0.5 * (grid.lower_mm() + grid.upper_mm());
  const double focus_mm =
      options.focus_distance_mm > 0 ? options.focus_distance_mm : (camera.camera_from_world * centre).z();
  return {options.focal_length_mm / options.f_number, focus_mm};
}

// The level projector, directly or behind a rectification; none when the cameras do not allow either.
std::shared_ptr<const ProjectorEngine> fast_engine(const Rig& rig, const Grid& grid, const Layout& layout,
                                                   const ProjectorOptions& options) {
  std::vector<PixelModel> models;
  for (const Camera& c : rig.cameras) {
    const Lens lens = lens_of(c, grid, options);
    models.push_back(
        {.area = options.pixel_area, .aperture_mm = lens.aperture_mm, .focus_mm = lens.focus_mm});
  }
  if (std::ranges::all_of(rig.cameras, [](const Camera& c) { return is_level(c); })) {
    std::vector<LevelView> views;
    for (std::size_t v = 0; v < models.size(); ++v) views.emplace_back(rig.cameras[v], grid, models[v]);
    if (!LevelEngine::obstacle(views).empty()) return nullptr;
    return std::make_shared<LevelEngine>(std::move(views), layout);
  }
  if (!RectifiedEngine::obstacle(rig, grid, models).empty()) return nullptr;
  return std::make_shared<RectifiedEngine>(rig, grid, layout, models);
}

}  // namespace

Result<Projector> Projector::make(const Rig& rig, const Grid& grid, const ProjectorOptions& options,
                                  Team& team, Ranks* ranks) {
  if (auto ok = check(rig, grid, options, ranks != nullptr); !ok) return tl::unexpected(ok.error());
  const Result<Share> share = ranks ? Share::among(*ranks, grid) : Share(grid);
  if (!share) return tl::unexpected(share.error());
  Projector out(*share);
  const auto layout_of = [&](const Grid& held) {
    return Layout(held, static_cast<int>(rig.cameras.size()), rig.cameras.front().image_height_px,
                  rig.cameras.front().image_width_px);
  };
  out.layout_ = layout_of(out.grid_);
  const Layout whole = layout_of(grid);
  out.cameras_ = rig.cameras;
  for (const Camera& c : rig.cameras) out.view_names_.push_back(c.name);
  out.all_views_.resize(out.views());
  std::iota(out.all_views_.begin(), out.all_views_.end(), std::size_t{0});
  if (!options.trilinear) {
    if ((out.engine_ = fast_engine(rig, grid, whole, options))) return out;
  }
  if (ranks) {
    return invalid_input(
        "the ray tracer and several ranks",
        "it was asked for, or is all that can serve these cameras, and needs the whole volume",
        "set projector.trilinear=false, use pixels of at most 4 voxels, or run without ranks");
  }
  if (options.f_number > 0) {
    return invalid_input(
        concat("projector: f_number=", options.f_number),
        "the ray tracer, which was asked for or is all that can serve these cameras, has pinholes",
        "set projector.f_number=0, or trilinear=false with pixels of at most 4 voxels, blur included");
  }
  const double budget_bytes = options.memory_budget_mib * 1048576;
  if (StoredMatrix::estimated_bytes(rig, grid, options, team) <= budget_bytes) {
    out.engine_ = std::make_shared<StoredMatrix>(rig, grid, whole, options, team);
  } else {
    out.engine_ = std::make_shared<RayEngine>(rig, grid, whole, options);
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
  std::vector<Share::Range> ranges;
  const std::size_t size = layout_.pixels_per_view();
  for (const std::size_t view : views) {
    if (!ranges.empty() && ranges.back().begin + ranges.back().size == view * size)
      ranges.back().size += size;
    else
      ranges.push_back({view * size, size});
  }
  share_.sum_images(team, ranges, projections, [&](const Planes& planes, std::span<float> images) {
    const std::size_t begin = layout_.voxel(0, 0, planes.begin - share_.planes().begin);
    const std::size_t end = layout_.voxel(0, 0, planes.end - share_.planes().begin);
    engine_->forward(team, views, planes, volume.subspan(begin, end - begin), images);
  });
}
void Projector::adjoint(Team& team, std::span<const std::size_t> views, std::span<const float> projections,
                        std::span<float> volume) const {
  expect(volume.size() == layout_.voxels() && projections.size() == layout_.pixels(),
         "shapes match the projector");
  engine_->adjoint(team, views, projections, share_.planes(), volume);
}
void Projector::column(std::size_t voxel, std::vector<ColumnEntry>& entries) const {
  expect(voxel < grid_.voxels() && share_.is_alone(), "the voxel is in the grid, all of which is held");
  entries.clear();
  engine_->column(voxel, entries);
}

}  // namespace flamefield
