#include "reconstruct/phantom/front.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace flamefield {

namespace {

// (1 - (d / w)^2)^4: a bell that is exactly zero beyond w = sqrt(8) standard deviations, so that there is
// empty space around a flame. The preheat side is wider than the burnt side, as in heat-release profiles.
constexpr float kWidth = 2.8284271f, kPreheatSide = 1.25f, kBurntSide = 0.75f;

float profile(float level, float thickness) {
  const float width = kWidth * thickness * (level < 0 ? kPreheatSide : kBurntSide);
  const float u = 1 - (level / width) * (level / width);
  return u > 0 ? (u * u) * (u * u) : 0;
}

// Where a lattice coordinate lies between nodes.
struct Knot {
  int node = 0;
  float weight = 0;
};
Knot knot_at(double position, int nodes) {
  const double inside = std::clamp(position, 0.0, static_cast<double>(nodes - 1));
  const int node = std::min(static_cast<int>(inside), nodes - 2);
  return {node, static_cast<float>(inside - node)};
}

// One axis of the target grid: knots of every sub-sample of every voxel.
struct Axis {
  int voxels = 0, samples = 0;
  std::vector<Knot> knots;  // (voxels, samples)
  const Knot& at(int voxel, int sample) const {
    return knots[static_cast<std::size_t>(voxel * samples + sample)];
  }
};
Axis axis_of(int voxels, int samples, double extent, const Lattice& lattice, std::size_t axis) {
  Axis out{voxels, samples, {}};
  for (int i = 0; i < voxels * samples; ++i) {
    out.knots.push_back(
        knot_at((i + 0.5) / (voxels * samples) * extent / lattice.spacing, lattice.nodes[axis]));
  }
  return out;
}

class Painter {
 public:
  Painter(const std::vector<Front>& fronts, const Lattice& lattice) : fronts_(fronts), lattice_(lattice) {
    row_ = static_cast<std::size_t>(lattice.nodes[0]);
    plane_ = row_ * static_cast<std::size_t>(lattice.nodes[1]);
    corners_ = {0, 1, row_, row_ + 1, plane_, plane_ + 1, plane_ + row_, plane_ + row_ + 1};
    near_.assign(lattice.size(), 0);
  }

  // Trilinear values lie between those of the corners: a cell whose corners are all too far off is empty.
  void find_near_cells(int z) {
    for (int y = 0; y + 1 < lattice_.nodes[1]; ++y)
      for (int x = 0; x + 1 < lattice_.nodes[0]; ++x) {
        const std::size_t cell = lattice_.index(x, y, z);
        for (const Front& front : fronts_) near_[cell] |= is_near(front, cell);
      }
  }

  bool any_near(const Axis& ax, const Axis& ay, const Axis& az, int x, int y, int z) const {
    for (int k = az.at(z, 0).node; k <= az.at(z, az.samples - 1).node; ++k)
      for (int j = ay.at(y, 0).node; j <= ay.at(y, ay.samples - 1).node; ++j)
        for (int i = ax.at(x, 0).node; i <= ax.at(x, ax.samples - 1).node; ++i)
          if (near_[lattice_.index(i, j, k)]) return true;
    return false;
  }

  float emission(const Knot& x, const Knot& y, const Knot& z) const {
    const std::size_t cell = lattice_.index(x.node, y.node, z.node);
    if (!near_[cell]) return 0;
    float brightest = 0;
    for (const Front& front : fronts_) {
      const float bell = profile(interpolate(front.level.data() + cell, x, y, z), front.thickness);
      if (bell > 0)
        brightest = std::max(brightest, bell * interpolate(front.brightness.data() + cell, x, y, z));
    }
    return brightest;
  }

 private:
  bool is_near(const Front& front, std::size_t cell) const {
    float low = front.level[cell], high = low, brightest = 0;
    for (std::size_t corner : corners_) {
      low = std::min(low, front.level[cell + corner]);
      high = std::max(high, front.level[cell + corner]);
      brightest = std::max(brightest, front.brightness[cell + corner]);
    }
    return brightest > 0 && high > -kWidth * kPreheatSide * front.thickness &&
           low < kWidth * kBurntSide * front.thickness;
  }

  float interpolate(const float* v, const Knot& x, const Knot& y, const Knot& z) const {
    const auto lerp = [](float a, float b, float t) { return a + (b - a) * t; };
    const auto along_x = [&](std::size_t c) { return lerp(v[c], v[c + 1], x.weight); };
    return lerp(lerp(along_x(0), along_x(row_), y.weight),
                lerp(along_x(plane_), along_x(plane_ + row_), y.weight), z.weight);
  }

  const std::vector<Front>& fronts_;
  const Lattice& lattice_;
  std::size_t row_, plane_;
  std::array<std::size_t, 8> corners_;
  std::vector<std::uint8_t> near_;
};

// Four sub-samples per standard deviation of the thinnest front, no more than five a voxel.
int samples_per_voxel(const std::vector<Front>& fronts, double voxel) {
  float thinnest = 1;
  for (const Front& front : fronts) thinnest = std::min(thinnest, front.thickness);
  return std::clamp(static_cast<int>(std::ceil(4 * voxel / thinnest)), 1, 5);
}

}  // namespace

Volume paint(const std::vector<Front>& fronts, const Lattice& lattice, const Grid& grid, Team& team) {
  const Eigen::Vector3d box =
      (grid.upper_mm() - grid.lower_mm()) / (grid.upper_mm().x() - grid.lower_mm().x());
  const auto axis = [&](int voxels, Eigen::Index a) {
    return axis_of(voxels, samples_per_voxel(fronts, box[a] / voxels), box[a], lattice,
                   static_cast<std::size_t>(a));
  };
  const Axis ax = axis(grid.nx, 0), ay = axis(grid.ny, 1), az = axis(grid.nz, 2);
  Painter painter(fronts, lattice);
  team.run(static_cast<std::size_t>(lattice.nodes[2] - 1),
           [&](std::size_t z) { painter.find_near_cells(static_cast<int>(z)); });
  Volume out(grid);
  const float share = 1 / static_cast<float>(ax.samples * ay.samples * az.samples);
  team.run(static_cast<std::size_t>(grid.nz), [&](std::size_t plane) {
    const int z = static_cast<int>(plane);
    for (int y = 0; y < grid.ny; ++y)
      for (int x = 0; x < grid.nx; ++x) {
        if (!painter.any_near(ax, ay, az, x, y, z)) continue;
        float sum = 0;
        for (int k = 0; k < az.samples; ++k)
          for (int j = 0; j < ay.samples; ++j)
            for (int i = 0; i < ax.samples; ++i)
              sum += painter.emission(ax.at(x, i), ay.at(y, j), az.at(z, k));
        out.at(x, y, z) = sum * share;
      }
  });
  return out;
}

}  // namespace flamefield
