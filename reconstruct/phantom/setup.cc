#include "reconstruct/phantom/setup.h"

#include <numbers>

namespace flamefield {

PhantomSetup paper_setup(PhantomKind kind) {
  constexpr double kDegree = std::numbers::pi / 180;
  switch (kind) {
    case PhantomKind::Torus:
      return {40, 40, 40, 1, 8, 22.5 * kDegree, 300};
    case PhantomKind::HollowSphere:
    case PhantomKind::Gaussian:
      return {40, 40, 40, 1, 10, 18 * kDegree, 300};
    case PhantomKind::Bunsen:
      return {50, 60, 50, 2, 23, 7.5 * kDegree, 440};
    case PhantomKind::Swirl:
      return {66, 43, 66, 2, 24, 7.5 * kDegree, 580};
    case PhantomKind::Stratified:
      return {52, 55, 52, 1.32, 15, 12 * kDegree, 300};
  }
  return {};
}

}  // namespace flamefield
