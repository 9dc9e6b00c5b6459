#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "reconstruct/parallel.h"
#include "reconstruct/projector.h"
#include "reconstruct/settings.h"

namespace flamefield {

// What is known of the field before any image is looked at (recipe table [constraints]).
struct Constraints {
  bool non_negative = true;
  bool visual_hull = false;
  double hull_threshold = 0.05;  // a brighter pixel is lit; share of the brightest
};
std::vector<SettingField> fields_of(Constraints& constraints);

// Packed: 1 for voxels that every view which sees them sees as lit, 0 for others and for padding (Laurentini,
// IEEE Trans. Pattern Anal. Mach. Intell. 16, 1994). A view sees a voxel that any of its rays meets, and sees
// it as lit when a lit pixel's ray meets it. images: packed, brightest pixel 1.
std::vector<std::uint8_t> visual_hull(const Projector& projector, std::span<const float> images,
                                      double threshold, Team& team);

}  // namespace flamefield
