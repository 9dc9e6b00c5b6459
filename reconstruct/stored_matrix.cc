#include "reconstruct/stored_matrix.h"

#include <cmath>
#include <numeric>

#include "proto/check.h"
#include "reconstruct/ray_march.h"

namespace flamefield {

namespace {

// Rows of A: collects the voxels that a pixel's rays touch.
class RowTracer {
 public:
  RowTracer(const Camera& camera, const Grid& grid, const ProjectorOptions& options)
      : grid_(grid),
        rays_(camera, options.pixel_samples),
        step_mm_(longest_step_mm(grid, options.step_voxels)),
        weights_(grid.voxels(), 0) {}

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
        const std::size_t voxel = grid_.index(x.lower + i, y.lower + j, z.lower + l);
        if (weights_[voxel] == 0) touched_.push_back(static_cast<std::uint32_t>(voxel));
        weights_[voxel] += weight;
      }
    }
  }

  const Grid& grid_;
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
    RowTracer tracer(camera, grid, options);
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

StoredMatrix::StoredMatrix(const Rig& rig, const Grid& grid, const ProjectorOptions& options, Team& team)
    : views_(rig.cameras.size()),
      pixels_per_view_(static_cast<std::size_t>(rig.cameras.front().image_width_px) *
                       static_cast<std::size_t>(rig.cameras.front().image_height_px)) {
  team.run(views_.size(), [&](std::size_t v) {
    const Camera& camera = rig.cameras[v];
    RowTracer tracer(camera, grid, options);
    std::vector<std::uint32_t> voxels;
    std::vector<float> weights;
    std::vector<std::size_t> row_end;
    View& view = views_[v];
    view.start.assign(grid.voxels() + 1, 0);
    for (int y = 0; y < camera.image_height_px; ++y)
      for (int x = 0; x < camera.image_width_px; ++x) {
        tracer.row(x, y, [&](std::uint32_t voxel, float weight) {
          voxels.push_back(voxel);
          weights.push_back(weight);
          ++view.start[voxel + 1];
        });
        row_end.push_back(voxels.size());
      }
    expect(voxels.size() < 0xffffffffu, "a view has fewer than 2^32 entries");
    // Counting sort from rows to columns.
    std::partial_sum(view.start.begin(), view.start.end(), view.start.begin());
    std::vector<std::uint32_t> next(view.start.begin(), view.start.end() - 1);
    view.pixel.resize(voxels.size());
    view.weight.resize(voxels.size());
    std::size_t k = 0;
    for (std::size_t row = 0; row < row_end.size(); ++row)
      for (; k < row_end[row]; ++k) {
        const std::uint32_t to = next[voxels[k]]++;
        view.pixel[to] = static_cast<std::uint32_t>(row);
        view.weight[to] = weights[k];
      }
  });
}

void StoredMatrix::forward(Team& team, std::span<const std::size_t> views, std::span<const float> volume,
                           std::span<float> projections) const {
  team.run(views.size(), [&](std::size_t i) {
    const View& view = views_[views[i]];
    float* image = projections.data() + views[i] * pixels_per_view_;
    std::fill(image, image + pixels_per_view_, 0.0f);
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
                           std::span<float> volume) const {
  constexpr std::size_t kGrain = 4096;
  team.run_ranges(volume.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::fill(volume.begin() + static_cast<std::ptrdiff_t>(begin),
              volume.begin() + static_cast<std::ptrdiff_t>(end), 0.0f);
    for (const std::size_t v : views) {
      const View& view = views_[v];
      const float* image = projections.data() + v * pixels_per_view_;
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
  for (std::size_t v = 0; v < views_.size(); ++v) {
    const View& view = views_[v];
    const auto first = static_cast<std::uint32_t>(v * pixels_per_view_);
    for (std::uint32_t k = view.start[voxel]; k < view.start[voxel + 1]; ++k) {
      entries.push_back({first + view.pixel[k], view.weight[k]});
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
