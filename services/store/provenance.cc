#include "services/store/provenance.h"

namespace flamefield {

std::string_view program_version() {
  return FLAMEFIELD_VERSION;
}

}  // namespace flamefield
