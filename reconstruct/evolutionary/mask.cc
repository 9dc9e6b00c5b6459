#include "reconstruct/evolutionary/mask.h"

#include <algorithm>
#include <cmath>

namespace flamefield {

namespace {

constexpr float kUnseen = -1;

// Intensity of the nearest pixel in every view.
class Witnesses {
 public:
  Witnesses(const Projector& projector, std::span<const float> images)
      : projector_(projector), images_(images), views_(projector.cameras().size()) {}

  void look(std::size_t voxel, std::vector<float>& seen) const {
    const Grid& g = projector_.grid();
    const auto nx = static_cast<std::size_t>(g.nx), ny = static_cast<std::size_t>(g.ny);
    const Eigen::Vector3d at = g.voxel_centre_mm(
        static_cast<int>(voxel % nx), static_cast<int>(voxel / nx % ny), static_cast<int>(voxel / nx / ny));
    for (std::size_t v = 0; v < views_; ++v) seen[v] = intensity(v, at);
  }

 private:
  float intensity(std::size_t view, const Eigen::Vector3d& at_mm) const {
    const auto pixel = project(projector_.cameras()[view], at_mm);
    if (!pixel) return kUnseen;
    const double x = std::round(pixel->x()), y = std::round(pixel->y());
    if (!(x >= 0 && y >= 0 && x < projector_.cols() && y < projector_.rows())) return kUnseen;
    const auto cols = static_cast<std::size_t>(projector_.cols()),
               rows = static_cast<std::size_t>(projector_.rows());
    return std::max(
        0.0f, images_[(view * rows + static_cast<std::size_t>(y)) * cols + static_cast<std::size_t>(x)]);
  }

  const Projector& projector_;
  std::span<const float> images_;
  std::size_t views_;
};

bool consensus(const std::vector<float>& now, const std::vector<float>& candidate, float r) {
  for (std::size_t v = 0; v < now.size(); ++v) {
    if (now[v] == kUnseen || candidate[v] == kUnseen || now[v] == 0) continue;
    if (!(r * now[v] < candidate[v])) return false;
  }
  return true;
}

}  // namespace

Mask mask_from_images(const Projector& projector, std::span<const float> images, std::size_t samples,
                      Stream& stream) {
  const Witnesses witnesses(projector, images);
  const std::size_t voxels = projector.grid().voxels();
  std::vector<float> now(projector.views()), candidate(projector.views());
  std::uint64_t at = stream.below(voxels);
  witnesses.look(at, now);
  Mask mask;
  mask.reserve(samples);
  while (mask.size() < samples) {
    const std::uint64_t next = stream.below(voxels);
    witnesses.look(next, candidate);
    if (consensus(now, candidate, static_cast<float>(stream.uniform()))) {
      at = next;
      now.swap(candidate);
    }
    mask.push_back(static_cast<std::uint32_t>(at));
  }
  return mask;
}

std::vector<float> consensus_density(const StripTable& table, const Layout& layout,
                                     std::span<const float> images, Team& team) {
  std::vector<float> out(table.voxels(), 0);
  team.run_ranges(table.voxels(), 1024, [&](std::size_t begin, std::size_t end) {
    const auto views = static_cast<std::size_t>(layout.views);
    std::vector<Strip> scratch;
    std::vector<double> light(views), weight(views);
    for (std::size_t voxel = begin; voxel < end; ++voxel) {
      std::ranges::fill(light, 0);
      std::ranges::fill(weight, 0);
      for (const Strip& strip : table.of(voxel, scratch))
        for (std::size_t k = 0; k < Strip::kPixels; ++k) {
          if (strip.weight[k] == 0) continue;
          const std::size_t view = (strip.first + k) / layout.pixels_per_view();
          weight[view] += static_cast<double>(strip.weight[k]);
          light[view] += static_cast<double>(strip.weight[k] * std::max(0.0f, images[strip.first + k]));
        }
      double least = INFINITY;
      for (std::size_t v = 0; v < views; ++v)
        if (weight[v] > 0) least = std::min(least, light[v] / weight[v]);
      if (std::isfinite(least) && least > static_cast<double>(kDarkest))
        out[voxel] = static_cast<float>(least);
    }
  });
  return out;
}

Mask mask_from_field(std::span<const float> density, std::size_t samples, Stream& stream) {
  std::uint64_t at = stream.below(density.size());
  Mask mask;
  mask.reserve(samples);
  while (mask.size() < samples) {
    const std::uint64_t next = stream.below(density.size());
    if (static_cast<float>(stream.uniform()) * density[at] <= density[next]) at = next;
    mask.push_back(static_cast<std::uint32_t>(at));
  }
  return mask;
}

std::vector<float> gradient_magnitude(std::span<const float> field, const Grid& g) {
  std::vector<float> out(field.size());
  const auto difference = [&](int x, int y, int z, int n, int at, std::size_t stride) {
    const std::size_t i = g.index(x, y, z), up = at + 1 < n ? i + stride : i, down = at > 0 ? i - stride : i;
    return up == down ? 0.0f : (field[up] - field[down]) / static_cast<float>((up - down) / stride);
  };
  const auto row = static_cast<std::size_t>(g.nx), plane = row * static_cast<std::size_t>(g.ny);
  for (int z = 0; z < g.nz; ++z)
    for (int y = 0; y < g.ny; ++y)
      for (int x = 0; x < g.nx; ++x) {
        const float dx = difference(x, y, z, g.nx, x, 1), dy = difference(x, y, z, g.ny, y, row),
                    dz = difference(x, y, z, g.nz, z, plane);
        out[g.index(x, y, z)] = std::sqrt(dx * dx + dy * dy + dz * dz);
      }
  return out;
}

}  // namespace flamefield
