// One of the targets as libFuzzer wants it; the build says which.
#include <cstddef>
#include <cstdint>

#include "tests/fuzz/targets.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  flamefield::fuzz::FLAMEFIELD_FUZZ_TARGET({data, size});
  return 0;
}
