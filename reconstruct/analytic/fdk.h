#pragma once

#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/settings.h"

namespace flamefield {

// Filtered back-projection for cone beams (Feldkamp, Davis and Kress, J. Opt. Soc. Am. A 1, 1984; Kak and
// Slaney, Principles of Computerized Tomographic Imaging, 1988, sec. 3.6) from a level ring of cameras. Less
// than a whole turn is weighted by Parker (Med. Phys. 9, 1982). Wants many views: with few, the field between
// the lines of sight of neighbouring cameras is streaks.
enum class RampWindow { Ramp, SheppLogan, Hann };
struct FdkOptions {
  RampWindow window = RampWindow::Hann;
};
std::vector<SettingField> fdk_fields(FdkOptions& options);

// InvalidInput: cameras that are not a level, regular ring (ring_geometry.h).
Result<Solution> solve_fdk(const Problem& problem, const FdkOptions& options);

}  // namespace flamefield
