#include "reconstruct/evolutionary/misfit.h"

namespace flamefield {

double Misfit::total(std::span<const float> residual) const {
  double out = 0;
  for (const float r : residual) {
    const auto a = static_cast<double>(std::abs(r));
    out += p_ == 1 ? a : p_ == 2 ? a * a : std::pow(a, p_);
  }
  return out;
}

}  // namespace flamefield
