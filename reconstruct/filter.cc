#include "reconstruct/filter.h"

#include "proto/check.h"

namespace flamefield {

void smooth(std::vector<float>& volume, std::vector<float>& scratch, const Grid& g, double share,
            Team& team) {
  expect(volume.size() == g.voxels() && scratch.size() == g.voxels(), "shapes match the grid");
  const auto side = static_cast<float>(share / 12), centre = static_cast<float>(1 - share / 2);
  const auto row = static_cast<std::size_t>(g.nx), plane = row * static_cast<std::size_t>(g.ny);
  team.run(static_cast<std::size_t>(g.nz), [&](std::size_t slab) {
    const int z = static_cast<int>(slab);
    for (int y = 0; y < g.ny; ++y) {
      const float* v = volume.data() + g.index(0, y, z);
      const float *below = y > 0 ? v - row : v, *above = y + 1 < g.ny ? v + row : v;
      const float *before = z > 0 ? v - plane : v, *behind = z + 1 < g.nz ? v + plane : v;
      float* out = scratch.data() + g.index(0, y, z);
      for (std::size_t x = 0; x < row; ++x) {
        const float left = v[x > 0 ? x - 1 : x], right = v[x + 1 < row ? x + 1 : x];
        out[x] = centre * v[x] + side * (left + right + below[x] + above[x] + before[x] + behind[x]);
      }
    }
  });
  volume.swap(scratch);
}

}  // namespace flamefield
