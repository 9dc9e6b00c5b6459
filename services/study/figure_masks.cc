// The first stochastic mask (Algorithm 3) beside the image it was drawn from.
#include <algorithm>
#include <cmath>

#include "reconstruct/evolutionary/mask.h"
#include "reconstruct/projector.h"
#include "services/report/html.h"
#include "services/report/slice_figure.h"
#include "services/study/figures.h"

namespace flamefield {

namespace {

// Draws an image whose pixels are `mm` wide; rows run down, as in the camera.
std::string picture(const Image& image, Axis right, Axis up, double mm, const std::string& title,
                    const std::string& quantity) {
  Slice s;
  s.right = right, s.up = up;
  const double w = 0.5 * mm * image.width_px, h = 0.5 * mm * image.height_px;
  s.right_mm = {-w, w};
  s.up_mm = up == Axis::Y ? std::array{0.0, 2 * h} : std::array{-h, h};
  s.image = image;
  const ValueRange range = emission_range(image.pixels);
  return slice_svg(s, inferno(), range, {280 / (2 * w), true, true, title}) +
         colour_bar_svg(inferno(), range, quantity);
}

// A camera looks from outside and may have z to its left; figures have it to the right.
Image with_z_to_the_right(const Image& image, const Camera& camera) {
  const Eigen::Vector3d origin_mm = camera.camera_from_world * Eigen::Vector3d::Zero();
  const Eigen::Vector3d along_z_mm = camera.camera_from_world * Eigen::Vector3d::UnitZ();
  if (along_z_mm.x() > origin_mm.x()) return image;
  Image out = image;
  for (int y = 0; y < image.height_px; ++y)
    for (int x = 0; x < image.width_px; ++x) out.at(x, y) = image.at(image.width_px - 1 - x, y);
  return out;
}

}  // namespace

Result<std::string> masks_figure(const StudyFigure& figure, const FigureSource& source) {
  if (!source.results.first) return std::string();
  const StudyRun& run = *source.results.first;
  const auto scene = source.scenes.get(run.settings, 0);
  if (!scene) return tl::unexpected(scene.error());
  const Grid grid = run.settings.grid();
  Team team;
  const auto projector = Projector::make((*scene)->rig, grid, {}, team);
  if (!projector) return tl::unexpected(projector.error());
  Stream stream(static_cast<std::uint64_t>(run.settings.seed), 0);
  const auto samples = static_cast<std::size_t>(figure.samples);
  const Mask mask = mask_from_images(*projector, (*scene)->images.values, samples, stream);

  const Camera& camera = (*scene)->rig.cameras.front();
  Image measured(camera.image_width_px, camera.image_height_px), front = measured, top(grid.nx, grid.nz);
  std::ranges::copy((*scene)->images.view(0), measured.pixels.begin());
  const auto nx = static_cast<std::size_t>(grid.nx), ny = static_cast<std::size_t>(grid.ny);
  for (std::uint32_t voxel : mask) {
    const int x = static_cast<int>(voxel % nx), y = static_cast<int>(voxel / nx % ny),
              z = static_cast<int>(voxel / nx / ny);
    top.at(x, grid.nz - 1 - z) += 1;
    const auto pixel = project(camera, grid.voxel_centre_mm(x, y, z));
    if (!pixel) continue;
    const int column = static_cast<int>(std::lround(pixel->x())),
              row = static_cast<int>(std::lround(pixel->y()));
    if (column >= 0 && row >= 0 && column < front.width_px && row < front.height_px)
      front.at(column, row) += 1;
  }
  measured = with_z_to_the_right(measured, camera);
  front = with_z_to_the_right(front, camera);
  const double mm = grid.spacing_mm.x();
  return concat(
      "<div class=\"row\">",
      ::flamefield::figure(picture(measured, Axis::Z, Axis::Y, mm, "image, 0° view", "intensity (a.u. × mm)"),
                           caption_of(figure, "The image of the first camera; lengths as at the centre.")),
      ::flamefield::figure(
          picture(front, Axis::Z, Axis::Y, mm, "histogram, 0° view", "samples a pixel (count)"),
          concat("The mask's ", samples, " samples in the pixels of that camera.")),
      ::flamefield::figure(
          picture(top, Axis::X, Axis::Z, mm, "histogram, top view", "samples a column (count)"),
          concat("The same from above, by columns of voxels of ", number(mm, 3), " mm.")),
      "</div>");
}

}  // namespace flamefield
