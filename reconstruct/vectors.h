#pragma once

#include <span>
#include <vector>

#include "reconstruct/layout.h"
#include "reconstruct/parallel.h"
#include "reconstruct/projector.h"

namespace flamefield {

// Sums run over fixed blocks whose results are added in order: the same bits for any number of threads.
double dot(Team& team, std::span<const float> a, std::span<const float> b);
inline double squared_norm(Team& team, std::span<const float> a) {
  return dot(team, a, a);
}

// Of volumes, of which each rank holds some planes (share.h); of a whole volume the same bits as above.
double dot(const Projector& projector, Team& team, std::span<const float> a, std::span<const float> b);
inline double squared_norm(const Projector& projector, Team& team, std::span<const float> a) {
  return dot(projector, team, a, a);
}

// Ones, packed; the padding is zero.
std::vector<float> even_volume(const Layout& layout);
std::vector<float> even_images(const Layout& layout);

// y += factor x
void add_scaled(Team& team, double factor, std::span<const float> x, std::span<float> y);

}  // namespace flamefield
