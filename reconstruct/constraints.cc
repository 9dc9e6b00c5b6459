#include "reconstruct/constraints.h"

#include <array>

#include "reconstruct/vectors.h"

namespace flamefield {

std::vector<SettingField> fields_of(Constraints& o) {
  return {{"non_negative", "", 0, 1, "no voxel is below zero", &o.non_negative},
          {"visual_hull", "", 0, 1, "voxels that any view sees as dark stay zero", &o.visual_hull},
          {"hull_threshold", "", 0, 1, "a brighter pixel is lit; share of the brightest", &o.hull_threshold}};
}

std::vector<std::uint8_t> visual_hull(const Projector& projector, std::span<const float> images,
                                      double threshold, Team& team) {
  const Layout& layout = projector.layout();
  const std::vector<float> ones = even_images(layout);
  std::vector<float> lit(layout.pixels()), seen(layout.voxels()), seen_lit(layout.voxels());
  for (std::size_t p = 0; p < lit.size(); ++p)
    lit[p] = static_cast<double>(images[p]) > threshold ? 1.0f : 0.0f;
  std::vector<std::uint8_t> hull(layout.voxels(), 0);
  for (int z = 0; z < layout.nz; ++z)
    for (int x = 0; x < layout.nx; ++x)
      std::fill_n(hull.begin() + static_cast<std::ptrdiff_t>(layout.voxel(x, 0, z)), layout.ny,
                  std::uint8_t{1});
  constexpr float kTouch = 1e-3f;  // share of a voxel's rays; less is rounding
  constexpr std::size_t kGrain = 8192;
  for (std::size_t v = 0; v < projector.views(); ++v) {
    const std::array<std::size_t, 1> view = {v};
    projector.adjoint(team, view, ones, seen);
    projector.adjoint(team, view, lit, seen_lit);
    team.run_ranges(hull.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t j = begin; j < end; ++j)
        if (seen_lit[j] < kTouch * seen[j]) hull[j] = 0;
    });
  }
  return hull;
}

}  // namespace flamefield
