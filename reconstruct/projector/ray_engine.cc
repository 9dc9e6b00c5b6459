#include "reconstruct/projector/ray_engine.h"

#include <cmath>

namespace flamefield {

namespace {

struct SampleRange {
  int begin = 0, end = 0;
};

// Samples whose coordinate on an axis lies in [low, high], one more on both sides for rounding.
SampleRange samples_between(const MarchedRay& ray, std::size_t axis, float low, float high) {
  const float first = ray.first[axis], advance = ray.advance[axis];
  if (std::abs(advance) < 1e-6f) return {0, ray.samples};
  const float a = (low - first) / advance, b = (high - first) / advance;
  const auto clamped = [&](float v) {
    return static_cast<int>(std::clamp(v, 0.0f, static_cast<float>(ray.samples)));
  };
  return {clamped(std::floor(std::min(a, b)) - 1), clamped(std::ceil(std::max(a, b)) + 2)};
}

}  // namespace

RayEngine::RayEngine(const Rig& rig, const Grid& grid, const Layout& layout, const ProjectorOptions& options)
    : rig_(rig),
      grid_(grid),
      layout_(layout),
      pixel_samples_(options.pixel_samples),
      step_mm_(longest_step_mm(grid, options.step_voxels)) {}

std::vector<MarchedRay> RayEngine::rays_of(Team& team, std::size_t view) const {
  const PixelRays rays(rig_.cameras[view], pixel_samples_);
  const auto per_pixel = static_cast<std::size_t>(rays.per_pixel());
  std::vector<MarchedRay> out(layout_.pixels_per_view() * per_pixel);  // padding: rays without samples
  team.run(static_cast<std::size_t>(layout_.cols), [&](std::size_t col) {
    const int x = static_cast<int>(col);
    for (int y = 0; y < layout_.rows; ++y)
      for (std::size_t sub = 0; sub < per_pixel; ++sub) {
        out[layout_.pixel(0, y, x) * per_pixel + sub] =
            march(grid_, rays.ray(x, y, static_cast<int>(sub)), step_mm_);
      }
  });
  return out;
}

void RayEngine::forward(Team& team, std::span<const std::size_t> views, const Planes&,
                        std::span<const float> volume, std::span<float> projections) const {
  const std::size_t pixels = layout_.pixels_per_view();
  for (const std::size_t view : views) {
    const std::vector<MarchedRay> rays = rays_of(team, view);
    const std::size_t per_pixel = rays.size() / pixels;
    team.run_ranges(pixels, 64, [&](std::size_t begin, std::size_t end) {
      for (std::size_t p = begin; p < end; ++p) {
        float sum = 0;
        for (std::size_t sub = 0; sub < per_pixel; ++sub) {
          const MarchedRay& ray = rays[p * per_pixel + sub];
          float along = 0;
          for (int k = 0; k < ray.samples; ++k) {
            const Cell x = cell_at(ray.at(0, k), grid_.nx), y = cell_at(ray.at(1, k), grid_.ny),
                       z = cell_at(ray.at(2, k), grid_.nz);
            for (int corner = 0; corner < 8; ++corner) {
              const int i = corner & 1, j = corner >> 1 & 1, l = corner >> 2;
              const float weight = (i ? x.weight : 1 - x.weight) * (j ? y.weight : 1 - y.weight) *
                                   (l ? z.weight : 1 - z.weight);
              if (weight != 0) along += weight * volume[layout_.voxel(x.lower + i, y.lower + j, z.lower + l)];
            }
          }
          sum += along * ray.step_mm;
        }
        projections[view * pixels + p] = sum / static_cast<float>(per_pixel);
      }
    });
  }
}

// What falls on planes from_z .. to_z - 1; the order of additions to a voxel is that of the rays.
void RayEngine::gather_slab(const std::vector<MarchedRay>& rays, std::span<const float> image, int from_z,
                            int to_z, std::span<float> volume) const {
  const std::size_t per_pixel = rays.size() / image.size();
  const float low = from_z == 0 ? -1.0f : static_cast<float>(from_z - 1);
  const float high = to_z == grid_.nz ? static_cast<float>(grid_.nz) : static_cast<float>(to_z);
  for (std::size_t r = 0; r < rays.size(); ++r) {
    const MarchedRay& ray = rays[r];
    const float value = image[r / per_pixel] * ray.step_mm / static_cast<float>(per_pixel);
    if (value == 0) continue;
    const SampleRange range = samples_between(ray, 2, low, high);
    for (int k = range.begin; k < range.end; ++k) {
      const Cell z = cell_at(ray.at(2, k), grid_.nz);
      if (z.lower + 1 < from_z || z.lower >= to_z) continue;
      const Cell x = cell_at(ray.at(0, k), grid_.nx), y = cell_at(ray.at(1, k), grid_.ny);
      for (int corner = 0; corner < 8; ++corner) {
        const int i = corner & 1, j = corner >> 1 & 1, l = corner >> 2;
        if (z.lower + l < from_z || z.lower + l >= to_z) continue;
        const float weight =
            (i ? x.weight : 1 - x.weight) * (j ? y.weight : 1 - y.weight) * (l ? z.weight : 1 - z.weight);
        if (weight != 0) volume[layout_.voxel(x.lower + i, y.lower + j, z.lower + l)] += weight * value;
      }
    }
  }
}

void RayEngine::adjoint(Team& team, std::span<const std::size_t> views, std::span<const float> projections,
                        const Planes&, std::span<float> volume) const {
  constexpr std::size_t kPlanes = 8;
  const std::size_t pixels = layout_.pixels_per_view();
  std::fill(volume.begin(), volume.end(), 0.0f);
  for (const std::size_t view : views) {
    const std::vector<MarchedRay> rays = rays_of(team, view);
    team.run_ranges(static_cast<std::size_t>(grid_.nz), kPlanes, [&](std::size_t begin, std::size_t end) {
      gather_slab(rays, projections.subspan(view * pixels, pixels), static_cast<int>(begin),
                  static_cast<int>(end), volume);
    });
  }
}

float RayEngine::weight_of(const MarchedRay& ray, const std::array<int, 3>& voxel) const {
  const std::array<int, 3> size = {grid_.nx, grid_.ny, grid_.nz};
  SampleRange range{0, ray.samples};
  for (std::size_t a = 0; a < 3; ++a) {
    const SampleRange own =
        samples_between(ray, a, static_cast<float>(voxel[a] - 1), static_cast<float>(voxel[a] + 1));
    range = {std::max(range.begin, own.begin), std::min(range.end, own.end)};
  }
  float sum = 0;
  for (int k = range.begin; k < range.end; ++k) {
    float weight = 1;
    for (std::size_t a = 0; a < 3; ++a) {
      const Cell cell = cell_at(ray.at(a, k), size[a]);
      weight *= cell.lower == voxel[a] ? 1 - cell.weight : cell.lower + 1 == voxel[a] ? cell.weight : 0;
    }
    sum += weight;
  }
  return sum * ray.step_mm;
}

void RayEngine::column(std::size_t voxel, std::vector<ColumnEntry>& entries) const {
  const auto nx = static_cast<std::size_t>(grid_.nx), ny = static_cast<std::size_t>(grid_.ny);
  const std::array<int, 3> at = {static_cast<int>(voxel % nx), static_cast<int>(voxel / nx % ny),
                                 static_cast<int>(voxel / nx / ny)};
  const int rows = layout_.rows, cols = layout_.cols;
  const std::size_t pixels = static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols);
  for (std::size_t v = 0; v < rig_.cameras.size(); ++v) {
    const Camera& camera = rig_.cameras[v];
    // The pixels that the voxel's support, two voxels wide, can reach.
    double x0 = cols, x1 = -1, y0 = rows, y1 = -1;
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d off(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
      const auto pixel =
          project(camera, grid_.voxel_centre_mm(at[0], at[1], at[2]) + off.cwiseProduct(grid_.spacing_mm));
      if (!pixel) {
        x0 = y0 = 0, x1 = cols, y1 = rows;
        break;
      }
      x0 = std::min(x0, pixel->x()), x1 = std::max(x1, pixel->x());
      y0 = std::min(y0, pixel->y()), y1 = std::max(y1, pixel->y());
    }
    const PixelRays rays(camera, pixel_samples_);
    for (int y = std::max(0, static_cast<int>(std::floor(y0)) - 1);
         y < std::min(rows, static_cast<int>(std::ceil(y1)) + 2); ++y)
      for (int x = std::max(0, static_cast<int>(std::floor(x0)) - 1);
           x < std::min(cols, static_cast<int>(std::ceil(x1)) + 2); ++x) {
        float weight = 0;
        for (int sub = 0; sub < rays.per_pixel(); ++sub)
          weight += weight_of(march(grid_, rays.ray(x, y, sub), step_mm_), at);
        if (weight == 0) continue;
        const std::size_t pixel = v * pixels + static_cast<std::size_t>(y) * static_cast<std::size_t>(cols) +
                                  static_cast<std::size_t>(x);
        entries.push_back({static_cast<std::uint32_t>(pixel), weight / static_cast<float>(rays.per_pixel())});
      }
  }
}

}  // namespace flamefield
