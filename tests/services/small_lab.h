#pragma once

#include "services/selftest/miniature.h"

namespace flamefield::testing_support {

using SmallLab = Miniature;

}  // namespace flamefield::testing_support
