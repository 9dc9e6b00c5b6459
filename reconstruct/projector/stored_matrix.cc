#include "reconstruct/projector/stored_matrix.h"

#include <cmath>
#include <numeric>

#include "proto/check.h"
#include "reconstruct/projector/ray_march.h"

namespace flamefield {

namespace {

// Rows of A: collects the voxels that a pixel's rays touch.
class RowTracer {
 public:
  RowTracer(const Camera& camera, const Grid& grid, const Layout& layout, const ProjectorOptions& options)
      : grid_(grid),
        layout_(layout),
        rays_(camera, options.pixel_samples),
        step_mm_(longest_step_mm(grid, options.step_voxels)),
        weights_(layout.voxels(), 0) {}

  // emit(voxel, weight in mm) for every voxel the pixel sees.
  template <class Emit>
  void row(int x_px, int y_px, const Emit& emit) {
    for (int sub = 0; sub < rays_.per_pixel(); ++sub) add(march(grid_, rays_.ray(x_px, y_px, sub), step_mm_));
    for (const std::uint32_t voxel : touched_) {
      emit(voxel, weights_[voxel]);
      weights_[voxel] = 0;
    }
    touched_.clear();
  }

 private:
  void add(const MarchedRay& ray) {
    const float ds = ray.step_mm / static_cast<float>(rays_.per_pixel());
    for (int k = 0; k < ray.samples; ++k) {
      const Cell x = cell_at(ray.at(0, k), grid_.nx), y = cell_at(ray.at(1, k), grid_.ny),
                 z = cell_at(ray.at(2, k), grid_.nz);
      for (int corner = 0; corner < 8; ++corner) {
        const int i = corner & 1, j = corner >> 1 & 1, l = corner >> 2;
        const float weight = ds * (i ? x.weight : 1 - x.weight) * (j ? y.weight : 1 - y.weight) *
                             (l ? z.weight : 1 - z.weight);
        if (weight == 0) continue;  // also where a single layer has no upper neighbour
        const std::size_t voxel = layout_.voxel(x.lower + i, y.lower + j, z.lower + l);
        if (weights_[voxel] == 0) touched_.push_back(static_cast<std::uint32_t>(voxel));
        weights_[voxel] += weight;
      }
    }
  }

  const Grid& grid_;
  const Layout& layout_;
  PixelRays rays_;
  double step_mm_;
  std::vector<float> weights_;  // all zero between rows
  std::vector<std::uint32_t> touched_;
};

}  // namespace

double StoredMatrix::estimated_bytes(const Rig& rig, const Grid& grid, const ProjectorOptions& options,
                                     Team& team) {
  constexpr int kStride = 67;
  std::vector<double> bytes(rig.cameras.size());
  team.run(rig.cameras.size(), [&](std::size_t v) {
    const Camera& camera = rig.cameras[v];
    const Layout layout(grid, 1, camera.image_height_px, camera.image_width_px);
    RowTracer tracer(camera, grid, layout, options);
    std::size_t entries = 0;
    const int pixels = camera.image_width_px * camera.image_height_px;
    int traced = 0;
    for (int p = static_cast<int>(v) % kStride; p < pixels; p += kStride, ++traced) {
      tracer.row(p % camera.image_width_px, p / camera.image_width_px,
                 [&](std::uint32_t, float) { ++entries; });
    }
    const double per_pixel = static_cast<double>(entries) / std::max(traced, 1);
    bytes[v] = per_pixel * pixels * 8.0 + static_cast<double>(grid.voxels()) * 4.0;
  });
  return std::accumulate(bytes.begin(), bytes.end(), 0.0);
}

StoredMatrix::StoredMatrix(const Rig& rig, const Grid& grid, const Layout& layout,
                           const ProjectorOptions& options, Team& team)
    : views_(rig.cameras.size()), grid_(grid), layout_(layout) {
  team.run(views_.size(), [&](std::size_t v) {
    const Camera& camera = rig.cameras[v];
    RowTracer tracer(camera, grid, layout, options);
    std::vector<std::uint32_t> voxels;
    std::vector<float> weights;
    std::vector<std::pair<std::uint32_t, std::size_t>> row_end;  // (pixel, end of its entries)
    View& view = views_[v];
    view.start.assign(layout.voxels() + 1, 0);
    for (int x = 0; x < camera.image_width_px; ++x)
      for (int y = camera.image_height_px - 1; y >= 0; --y) {
        tracer.row(x, y, [&](std::uint32_t voxel, float weight) {
          voxels.push_back(voxel);
          weights.push_back(weight);
          ++view.start[voxel + 1];
        });
        row_end.emplace_back(layout.pixel(0, y, x), voxels.size());
      }
    expect(voxels.size() < 0xffffffffu, "a view has fewer than 2^32 entries");
    // Counting sort from rows to columns.
    std::partial_sum(view.start.begin(), view.start.end(), view.start.begin());
    std::vector<std::uint32_t> next(view.start.begin(), view.start.end() - 1);
    view.pixel.resize(voxels.size());
    view.weight.resize(voxels.size());
    std::size_t k = 0;
    for (const auto& [pixel, end] : row_end)
      for (; k < end; ++k) {
        const std::uint32_t to = next[voxels[k]]++;
        view.pixel[to] = pixel;
        view.weight[to] = weights[k];
      }
  });
}

void StoredMatrix::forward(Team& team, std::span<const std::size_t> views, const Planes&,
                           std::span<const float> volume, std::span<float> projections) const {
  team.run(views.size(), [&](std::size_t i) {
    const View& view = views_[views[i]];
    float* image = projections.data() + views[i] * layout_.pixels_per_view();
    std::fill(image, image + layout_.pixels_per_view(), 0.0f);
    for (std::size_t voxel = 0; voxel < volume.size(); ++voxel) {
      const float value = volume[voxel];
      if (value == 0) continue;
      for (std::uint32_t k = view.start[voxel]; k < view.start[voxel + 1]; ++k) {
        image[view.pixel[k]] += value * view.weight[k];
      }
    }
  });
}

void StoredMatrix::adjoint(Team& team, std::span<const std::size_t> views, std::span<const float> projections,
                           const Planes&, std::span<float> volume) const {
  constexpr std::size_t kGrain = 4096;
  team.run_ranges(volume.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::fill(volume.begin() + static_cast<std::ptrdiff_t>(begin),
              volume.begin() + static_cast<std::ptrdiff_t>(end), 0.0f);
    for (const std::size_t v : views) {
      const View& view = views_[v];
      const float* image = projections.data() + v * layout_.pixels_per_view();
      for (std::size_t voxel = begin; voxel < end; ++voxel) {
        float sum = 0;
        for (std::uint32_t k = view.start[voxel]; k < view.start[voxel + 1]; ++k) {
          sum += view.weight[k] * image[view.pixel[k]];
        }
        volume[voxel] += sum;
      }
    }
  });
}

void StoredMatrix::column(std::size_t voxel, std::vector<ColumnEntry>& entries) const {
  const auto nx = static_cast<std::size_t>(grid_.nx), ny = static_cast<std::size_t>(grid_.ny);
  const std::size_t packed = layout_.voxel(static_cast<int>(voxel % nx), static_cast<int>(voxel / nx % ny),
                                           static_cast<int>(voxel / nx / ny));
  const auto rows = static_cast<std::size_t>(layout_.rows), cols = static_cast<std::size_t>(layout_.cols);
  for (std::size_t v = 0; v < views_.size(); ++v) {
    const View& view = views_[v];
    for (std::uint32_t k = view.start[packed]; k < view.start[packed + 1]; ++k) {
      const std::size_t col = view.pixel[k] / layout_.line, up = view.pixel[k] % layout_.line;
      const std::size_t row = rows - 1 - up;
      entries.push_back({static_cast<std::uint32_t>((v * rows + row) * cols + col), view.weight[k]});
    }
  }
}

std::string StoredMatrix::name() const {
  double bytes = 0;
  for (const View& view : views_)
    bytes += static_cast<double>(view.start.size()) * 4 + static_cast<double>(view.pixel.size()) * 8;
  return concat("stored ", std::llround(bytes / 1048576), " MiB");
}

}  // namespace flamefield
