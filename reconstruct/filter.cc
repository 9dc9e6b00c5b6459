#include "reconstruct/filter.h"

#include "proto/check.h"

namespace flamefield {

void smooth(std::vector<float>& volume, std::vector<float>& scratch, const Layout& layout, double share,
            Team& team) {
  expect(volume.size() == layout.voxels() && scratch.size() == layout.voxels(), "shapes match the layout");
  const auto side = static_cast<float>(share / 12), centre = static_cast<float>(1 - share / 2);
  const auto ny = static_cast<std::size_t>(layout.ny);
  team.run(static_cast<std::size_t>(layout.nz), [&](std::size_t slab) {
    const int z = static_cast<int>(slab);
    const auto column = [&](int i, int k) { return volume.data() + layout.voxel(i, 0, k); };
    for (int x = 0; x < layout.nx; ++x) {
      const float* v = column(x, z);
      const float *left = column(x > 0 ? x - 1 : x, z), *right = column(x + 1 < layout.nx ? x + 1 : x, z);
      const float *before = column(x, z > 0 ? z - 1 : z), *behind = column(x, z + 1 < layout.nz ? z + 1 : z);
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

}  // namespace flamefield
