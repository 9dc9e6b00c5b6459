#pragma once

#include <vector>

#include "reconstruct/layout.h"

namespace flamefield {

// The slabs that a volume of nz planes is cut into for ranks (share.h): so many of them can share it.
std::vector<Planes> slabs_of(int nz);

}  // namespace flamefield
