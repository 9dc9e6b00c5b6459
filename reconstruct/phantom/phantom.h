#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "proto/volume.h"

namespace flamefield {

enum class PhantomKind { Torus, HollowSphere, Gaussian, Bunsen, Swirl, Stratified };
std::string_view name_of(PhantomKind kind);
bool evolves(PhantomKind kind);  // flames do, the canonical bodies stand still
std::optional<PhantomKind> phantom_kind_from_name(std::string_view name);

struct PhantomOptions {
  PhantomKind kind = PhantomKind::Torus;
  std::uint64_t seed = 1;  // of the turbulence; the canonical bodies ignore it
  double time_s = 0;       // the flames evolve in time, continuously
};

// The field in [0, 1], each voxel the average over its cell. The shape scales with the grid's box, so that
// the same flame can be made on any resolution.
Volume make_phantom(const PhantomOptions& options, const Grid& grid);

}  // namespace flamefield
