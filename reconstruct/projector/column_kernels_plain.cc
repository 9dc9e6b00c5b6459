// The oracle: every weight from footprint.h, one at a time.
#include "reconstruct/projector/column_kernels.h"

namespace flamefield {

namespace {

// visit(voxel in the volume, pixel in the images, weight)
template <class Visit>
void each_weight(const StripRow& row, const StripShape& shape, const Visit& visit) {
  for (int i = 0; i < row.count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const Footprint across = footprint(row.q[i], row.half[i], shape.others);
    if (across.count == 0) continue;
    for (int up = 0; up < shape.rows; ++up) {
      const double m = row.m[i];
      const Footprint along =
          footprint(shape.height + m * (up - shape.axis_up), m * row.half_px[i], shape.ny);
      for (int j = 0; j < across.count; ++j)
        for (int y = 0; y < along.count; ++y) {
          visit(row.plane + index * row.plane_step +
                    static_cast<std::size_t>(across.first + j) * shape.stride +
                    static_cast<std::size_t>(along.first + y),
                row.line + index * row.line_step + static_cast<std::size_t>(up),
                across.weight[j] * along.weight[y]);
        }
    }
  }
}

}  // namespace

void add_forward_plain(const float* volume, const StripRow& row, const StripShape& shape, float* images) {
  each_weight(row, shape, [&](std::size_t voxel, std::size_t pixel, float weight) {
    images[pixel] += weight * volume[voxel];
  });
}

void add_adjoint_plain(const float* images, const StripRow& row, const StripShape& shape, float* volume) {
  each_weight(row, shape, [&](std::size_t voxel, std::size_t pixel, float weight) {
    volume[voxel] += weight * images[pixel];
  });
}

}  // namespace flamefield
