#include "reconstruct/filter.h"

#include <algorithm>

#include "proto/check.h"

namespace flamefield {

namespace {

// Neighbouring planes that others hold; empty at the faces of the box.
struct Beyond {
  std::vector<float> before, behind;
};

void smooth(std::vector<float>& volume, std::vector<float>& scratch, const Layout& layout, double share,
            Team& team, const Beyond& beyond) {
  expect(volume.size() == layout.voxels() && scratch.size() == layout.voxels(), "shapes match the layout");
  const auto side = static_cast<float>(share / 12), centre = static_cast<float>(1 - share / 2);
  const auto ny = static_cast<std::size_t>(layout.ny);
  team.run(static_cast<std::size_t>(layout.nz), [&](std::size_t slab) {
    const int z = static_cast<int>(slab);
    const auto column = [&](int i, int k) -> const float* {
      if (k < 0 && !beyond.before.empty()) return beyond.before.data() + layout.voxel(i, 0, 0);
      if (k == layout.nz && !beyond.behind.empty()) return beyond.behind.data() + layout.voxel(i, 0, 0);
      return volume.data() + layout.voxel(i, 0, std::clamp(k, 0, layout.nz - 1));
    };
    for (int x = 0; x < layout.nx; ++x) {
      const float* v = column(x, z);
      const float *left = column(x > 0 ? x - 1 : x, z), *right = column(x + 1 < layout.nx ? x + 1 : x, z);
      const float *before = column(x, z - 1), *behind = column(x, z + 1);
      float* out = scratch.data() + layout.voxel(x, 0, z);
      std::fill(out + ny, out + layout.column, 0.0f);
      for (std::size_t y = 0; y < ny; ++y) {
        const float below = v[y > 0 ? y - 1 : y], above = v[y + 1 < ny ? y + 1 : y];
        out[y] = centre * v[y] + side * (left[y] + right[y] + below + above + before[y] + behind[y]);
      }
    }
  });
  volume.swap(scratch);
}

}  // namespace

void smooth(std::vector<float>& volume, std::vector<float>& scratch, const Layout& layout, double share,
            Team& team) {
  smooth(volume, scratch, layout, share, team, Beyond());
}

void smooth(std::vector<float>& volume, std::vector<float>& scratch, const Projector& projector, double share,
            Team& team) {
  const Share& held = projector.share();
  const std::size_t plane = projector.layout().voxel(0, 0, 1);
  Beyond beyond;
  if (held.has_before()) beyond.before.resize(plane);
  if (held.has_behind()) beyond.behind.resize(plane);
  held.pass_behind(std::span(volume).last(plane), beyond.before);
  held.pass_before(std::span(volume).first(plane), beyond.behind);
  smooth(volume, scratch, projector.layout(), share, team, beyond);
}

}  // namespace flamefield
