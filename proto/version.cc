#include "proto/version.h"

namespace flamefield {

std::string_view program_version() {
  return FLAMEFIELD_VERSION;
}

}  // namespace flamefield
