#pragma once

#include <array>
#include <cstdint>

namespace flamefield {

// Philox4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC'11): four words that depend
// on key and counter alone.
std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter, std::array<std::uint32_t, 2> key);

// A stream of random numbers named by (seed, stream): no state is shared, so the same numbers come out
// whichever thread asks. E.g. one stream per pixel, or one per offspring and generation.
class Stream {
 public:
  Stream(std::uint64_t seed, std::uint64_t stream) : seed_(seed), stream_(stream) {}

  std::uint32_t bits();
  double uniform();                                    // in (0, 1), 32 bits
  std::uint64_t below(std::uint64_t n);                // 0 .. n - 1; n < 2^32
  double normal();                                     // mean 0, standard deviation 1
  double poisson(double mean);                         // normal approximation above 1000
  double truncated_normal(double mean, double sigma);  // cut off outside [0, 1]; mean within

 private:
  std::uint64_t seed_, stream_, counter_ = 0;
  std::array<std::uint32_t, 4> block_ = {};
  unsigned used_ = 4;
  double spare_normal_ = 0;
  bool has_spare_ = false;
};

}  // namespace flamefield
