#include "reconstruct/evolutionary/model.h"

#include <cmath>

#include "reconstruct/projector/ray_march.h"

namespace flamefield {

namespace {

constexpr int kPixelSamples = 2;
constexpr double kStepVoxels = 0.5;

// Trilinear in a packed volume.
float sample_packed(const Grid& grid, const Layout& layout, std::span<const float> volume,
                    const MarchedRay& ray, int k) {
  const Cell x = cell_at(ray.at(0, k), grid.nx), y = cell_at(ray.at(1, k), grid.ny),
             z = cell_at(ray.at(2, k), grid.nz);
  float sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int i = corner & 1, j = corner >> 1 & 1, l = corner >> 2;
    const float weight =
        (i ? x.weight : 1 - x.weight) * (j ? y.weight : 1 - y.weight) * (l ? z.weight : 1 - z.weight);
    if (weight != 0) sum += weight * volume[layout.voxel(x.lower + i, y.lower + j, z.lower + l)];
  }
  return sum;
}

}  // namespace

void SelfAbsorption::render(Team& team, std::span<const float> volume, std::span<float> images) const {
  const Layout& layout = projector_.layout();
  const Grid& grid = projector_.grid();
  const double step_mm = longest_step_mm(grid, kStepVoxels);
  std::ranges::fill(images, 0.0f);
  const auto cols = static_cast<std::size_t>(layout.cols);
  team.run(projector_.views() * cols, [&](std::size_t task) {
    const auto view = static_cast<int>(task / cols), col = static_cast<int>(task % cols);
    const PixelRays rays(projector_.cameras()[task / cols], kPixelSamples);
    for (int row = 0; row < layout.rows; ++row) {
      double sum = 0;
      for (int sub = 0; sub < rays.per_pixel(); ++sub) {
        const MarchedRay ray = march(grid, rays.ray(col, row, sub), step_mm);
        const auto ds = static_cast<double>(ray.step_mm);
        double depth = 0;  // optical, between camera and sample
        for (int k = 0; k < ray.samples; ++k) {
          const auto f = static_cast<double>(sample_packed(grid, layout, volume, ray, k));
          if (f == 0) continue;
          const double own = k_ * f * ds;  // half of a sample's depth lies before its middle
          sum += f * ds * std::exp(-depth - 0.5 * own);
          depth += own;
        }
      }
      images[layout.pixel(view, row, col)] = static_cast<float>(sum / rays.per_pixel());
    }
  });
}

std::unique_ptr<MeasurementModel> make_model(const Projector& projector, double absorption) {
  if (absorption > 0) return std::make_unique<SelfAbsorption>(projector, absorption);
  return std::make_unique<LinearModel>(projector);
}

}  // namespace flamefield
