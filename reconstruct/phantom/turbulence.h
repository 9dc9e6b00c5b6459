#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "reconstruct/parallel.h"
#include "reconstruct/phantom/lattice.h"

namespace flamefield {

// A random vector field of many scales: a sum of Fourier modes with amplitudes k^-4/3 (displacements of a
// k^-5/3 spectrum are steeper than its velocities), convected upward while each mode slowly changes phase.
struct TurbulenceOptions {
  std::uint64_t seed = 1;
  double time_s = 0;
  double longest = 0.6, shortest = 0.1;  // wavelengths, box sides
  double rms = 0.03;                     // of each component, box sides
  double rise_per_s = 0.8;               // box sides; slowed down so that pulses at 5 Hz show the motion
  double turnover_per_s = 0.5;           // of the longest wavelength, faster for shorter ones (k^2/3)
  int modes = 48;
};

// Three components at every lattice node.
using VectorField = std::array<std::vector<float>, 3>;
VectorField turbulence(const TurbulenceOptions& options, const Lattice& lattice, Team& team);

}  // namespace flamefield
