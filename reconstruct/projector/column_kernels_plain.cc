// The oracle: every weight from footprint.h, one at a time.
#include "reconstruct/projector/column_kernels.h"

namespace flamefield {

namespace {

// visit(voxel in the volume, pixel in the images, weight) for voxel columns begin .. end - 1
template <class Visit>
void each_weight(const StripPatch& patch, const StripShape& shape, int begin, int end, const Visit& visit) {
  for (int i = 0; i < patch.strips(); ++i) {
    const auto col = static_cast<std::size_t>(i / patch.planes),
               plane = static_cast<std::size_t>(i % patch.planes);
    const Footprint across = footprint(patch.q[i], patch.half[i], shape.others);
    for (int up = 0; across.count > 0 && up < shape.rows; ++up) {
      const double m = patch.m[i];
      const Footprint along =
          footprint(shape.height + m * (up - shape.axis_up), m * patch.half_px[i], shape.ny);
      for (int j = 0; j < across.count; ++j) {
        const int other = across.first + j;
        if (other < begin || other >= end) continue;
        for (int y = 0; y < along.count; ++y) {
          visit(patch.plane + plane * patch.plane_step + static_cast<std::size_t>(other) * shape.stride +
                    static_cast<std::size_t>(along.first + y),
                patch.line + col * patch.line_step + static_cast<std::size_t>(up),
                across.weight[j] * along.weight[y]);
        }
      }
    }
  }
}

}  // namespace

void add_forward_plain(const float* volume, const StripPatch& patch, const StripShape& shape, float* images) {
  each_weight(patch, shape, shape.begin, shape.end, [&](std::size_t voxel, std::size_t pixel, float weight) {
    images[pixel] += weight * volume[voxel];
  });
}

void add_adjoint_plain(const float* images, const StripPatch& patch, const StripShape& shape, float* volume) {
  each_weight(patch, shape, shape.begin, shape.end, [&](std::size_t voxel, std::size_t pixel, float weight) {
    volume[voxel] += weight * images[pixel];
  });
}

}  // namespace flamefield
