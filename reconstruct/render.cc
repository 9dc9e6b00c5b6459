#include "reconstruct/render.h"

#include <cmath>
#include <limits>

#include "proto/check.h"
#include "reconstruct/parallel.h"
#include "reconstruct/projector/ray_march.h"

namespace flamefield {

namespace {

constexpr int kBlock = 8;  // voxels per side of a block

struct PixelBox {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // half open
};

// The pixels that can see a box: from the images of points spread over it, since a lens bends its edges.
PixelBox pixels_seeing(const Camera& camera, const Eigen::Vector3d& lower, const Eigen::Vector3d& upper) {
  const PixelBox all{0, 0, camera.image_width_px, camera.image_height_px};
  constexpr int kPoints = 9;
  constexpr double kMarginPx = 2;
  double x0 = std::numeric_limits<double>::infinity(), y0 = x0, x1 = -x0, y1 = -x0;
  for (int i = 0; i < kPoints * kPoints * kPoints; ++i) {
    const Eigen::Vector3d f =
        Eigen::Vector3d(i % kPoints, i / kPoints % kPoints, i / kPoints / kPoints) / (kPoints - 1);
    const auto pixel = project(camera, lower + f.cwiseProduct(upper - lower));
    if (!pixel) return all;
    x0 = std::min(x0, pixel->x());
    x1 = std::max(x1, pixel->x());
    y0 = std::min(y0, pixel->y());
    y1 = std::max(y1, pixel->y());
  }
  const auto low = [](double v, int size) {
    return static_cast<int>(std::clamp(std::floor(v - kMarginPx), 0.0, static_cast<double>(size)));
  };
  const auto high = [](double v, int size) {
    return static_cast<int>(std::clamp(std::ceil(v + kMarginPx) + 1, 0.0, static_cast<double>(size)));
  };
  return {low(x0, all.x1), low(y0, all.y1), high(x1, all.x1), high(y1, all.y1)};
}

// Walks one ray. Knows the volume's strides and which blocks are empty.
class Tracer {
 public:
  Tracer(const Volume& volume, const std::array<int, 3>& blocks, const std::vector<std::uint8_t>& occupied)
      : values_(volume.values.data()), occupied_(occupied.data()), blocks_(blocks) {
    const Grid& g = volume.grid;
    size_ = {g.nx, g.ny, g.nz};
    row_ = static_cast<std::size_t>(g.nx);
    plane_ = row_ * static_cast<std::size_t>(g.ny);
    next_ = {g.nx > 1 ? 1u : 0u, g.ny > 1 ? row_ : 0u, g.nz > 1 ? plane_ : 0u};
  }

  float integral(const MarchedRay& ray) const {
    float sum = 0;
    for (int k = 0; k < ray.samples;) {
      const std::array<float, 3> p = {ray.at(0, k), ray.at(1, k), ray.at(2, k)};
      const Cell x = cell_at(p[0], size_[0]), y = cell_at(p[1], size_[1]), z = cell_at(p[2], size_[2]);
      const std::array<int, 3> block = {x.lower / kBlock, y.lower / kBlock, z.lower / kBlock};
      if (!occupied_[(block[2] * blocks_[1] + block[1]) * blocks_[0] + block[0]]) {
        k += samples_to_leave(ray, p, block);
        continue;
      }
      sum += interpolate(x, y, z);
      ++k;
    }
    return sum * ray.step_mm;
  }

 private:
  float interpolate(Cell x, Cell y, Cell z) const {
    const float* v = values_ + static_cast<std::size_t>(z.lower) * plane_ +
                     static_cast<std::size_t>(y.lower) * row_ + static_cast<std::size_t>(x.lower);
    const auto along_x = [&](const float* q) { return q[0] + (q[next_[0]] - q[0]) * x.weight; };
    const auto along_y = [&](const float* q) {
      const float a = along_x(q);
      return a + (along_x(q + next_[1]) - a) * y.weight;
    };
    const float a = along_y(v);
    return a + (along_y(v + next_[2]) - a) * z.weight;
  }

  // At least one; never past the first sample outside the block.
  int samples_to_leave(const MarchedRay& ray, const std::array<float, 3>& p,
                       const std::array<int, 3>& block) const {
    float least = static_cast<float>(ray.samples);
    for (std::size_t a = 0; a < 3; ++a) {
      const float advance = ray.advance[a];
      const int low = block[a] * kBlock, high = low + kBlock;
      if (advance > 0 && high < size_[a] - 1) {
        least = std::min(least, (static_cast<float>(high) - p[a]) / advance);
      } else if (advance < 0 && low > 0) {
        least = std::min(least, (static_cast<float>(low) - p[a]) / advance);
      }
    }
    return std::max(1, static_cast<int>(least));
  }

  const float* values_;
  const std::uint8_t* occupied_;
  std::array<int, 3> blocks_, size_;
  std::size_t row_, plane_;
  std::array<std::size_t, 3> next_;  // to the upper neighbour along each axis
};

}  // namespace

Renderer::Renderer(const Volume& volume) : volume_(volume) {
  const Grid& g = volume.grid;
  expect(volume.values.size() == g.voxels(), "the volume has a value for every voxel");
  const std::array<int, 3> size = {g.nx, g.ny, g.nz};
  for (std::size_t a = 0; a < 3; ++a) blocks_[a] = (size[a] + kBlock - 1) / kBlock;
  occupied_.assign(static_cast<std::size_t>(blocks_[0]) * static_cast<std::size_t>(blocks_[1]) *
                       static_cast<std::size_t>(blocks_[2]),
                   0);
  // A voxel serves the cells on both sides of it, so the first of a block also counts for the block before.
  const auto mark = [&](int x, int y, int z) {
    for (int bz = std::max(z - 1, 0) / kBlock; bz <= z / kBlock; ++bz)
      for (int by = std::max(y - 1, 0) / kBlock; by <= y / kBlock; ++by)
        for (int bx = std::max(x - 1, 0) / kBlock; bx <= x / kBlock; ++bx)
          occupied_[static_cast<std::size_t>((bz * blocks_[1] + by) * blocks_[0] + bx)] = 1;
  };
  std::array<int, 3> low = size, high = {-1, -1, -1};
  for (int z = 0; z < g.nz; ++z)
    for (int y = 0; y < g.ny; ++y)
      for (int x = 0; x < g.nx; ++x) {
        if (volume.at(x, y, z) == 0) continue;
        mark(x, y, z);
        const std::array<int, 3> at = {x, y, z};
        for (std::size_t a = 0; a < 3; ++a) {
          low[a] = std::min(low[a], at[a]);
          high[a] = std::max(high[a], at[a]);
        }
      }
  empty_ = high[0] < 0;
  lit_lower_mm_ = g.voxel_centre_mm(low[0] - 1, low[1] - 1, low[2] - 1).cwiseMax(g.lower_mm());
  lit_upper_mm_ = g.voxel_centre_mm(high[0] + 1, high[1] + 1, high[2] + 1).cwiseMin(g.upper_mm());
}

Image Renderer::view(const Camera& camera, const RenderOptions& options) const {
  expect(options.step_voxels > 0 && options.pixel_samples >= 1, "step and pixel samples are positive");
  Image image(camera.image_width_px, camera.image_height_px);
  if (empty_) return image;
  const Tracer tracer(volume_, blocks_, occupied_);
  const PixelRays rays(camera, options.pixel_samples, options.lens);
  const double step_mm = longest_step_mm(volume_.grid, options.step_voxels);
  const PixelBox box = pixels_seeing(camera, lit_lower_mm_, lit_upper_mm_);
  if (box.y1 <= box.y0 || box.x1 <= box.x0) return image;
  Team team(options.threads);
  team.run(static_cast<std::size_t>(box.y1 - box.y0), [&](std::size_t row) {
    const int y = box.y0 + static_cast<int>(row);
    for (int x = box.x0; x < box.x1; ++x) {
      float sum = 0;
      for (int sub = 0; sub < rays.per_pixel(); ++sub) {
        sum += tracer.integral(march(volume_.grid, rays.ray(x, y, sub), step_mm));
      }
      image.at(x, y) = sum / static_cast<float>(rays.per_pixel());
    }
  });
  return image;
}

Image render_view(const Volume& volume, const Camera& camera, const RenderOptions& options) {
  return Renderer(volume).view(camera, options);
}

Result<Projections> render(const Volume& volume, const Rig& rig, const RenderOptions& options) {
  if (auto ok = validate(volume.grid); !ok) return tl::unexpected(ok.error());
  if (auto ok = validate(rig); !ok) return tl::unexpected(ok.error());
  if (!(options.step_voxels > 0) || options.pixel_samples < 1) {
    return invalid_input(
        concat("step_voxels=", options.step_voxels, ", pixel_samples=", options.pixel_samples),
        "both must be positive", "use e.g. --step-voxels 0.5");
  }
  Projections out;
  out.rows = rig.cameras.front().image_height_px;
  out.cols = rig.cameras.front().image_width_px;
  const Renderer renderer(volume);
  for (const Camera& camera : rig.cameras) {
    if (camera.image_height_px != out.rows || camera.image_width_px != out.cols) {
      return invalid_input(concat("camera ", camera.name, " has ", camera.image_width_px, "x",
                                  camera.image_height_px, " px, the first one ", out.cols, "x", out.rows),
                           "projections share one size", "crop the cameras to one size");
    }
    const Image image = renderer.view(camera, options);
    out.view_names.push_back(camera.name);
    out.values.insert(out.values.end(), image.pixels.begin(), image.pixels.end());
  }
  return out;
}

}  // namespace flamefield
