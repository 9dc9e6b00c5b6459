#include "reconstruct/variational/differences.h"

#include <algorithm>
#include <cmath>

namespace flamefield {

namespace {

// Pointers to the fields of a dual, for the kernels.
template <std::size_t kFields>
std::array<float*, kFields> fields_of(Differences::Dual& dual) {
  std::array<float*, kFields> out = {};
  for (std::size_t i = 0; i < dual.size(); ++i) out[i] = dual[i].data();
  return out;
}

double sum(const std::vector<double>& slabs) {
  double out = 0;
  for (const double slab : slabs) out += slab;
  return out;
}

}  // namespace

Differences::Differences(const Grid& grid, const Layout& layout)
    : layout_(layout), below_top_(layout.column + 16, 0.0f), zeros_(layout.column + 32, 0.0f) {
  const double h = grid.spacing_mm.minCoeff();
  for (std::size_t axis = 0; axis < 3; ++axis)
    scale_[axis] = static_cast<float>(h / grid.spacing_mm[static_cast<Eigen::Index>(axis)]);
  for (int y = 0; y + 1 < layout.ny; ++y) below_top_[static_cast<std::size_t>(y) + 1] = 1;
}

PriorShape Differences::shape() const {
  return {layout_.nx, layout_.nz, layout_.column, scale_, below_top_.data() + 1, zeros_.data() + 16};
}

Differences::Dual Differences::make_dual(std::size_t fields) const {
  Dual out;
  for (std::size_t i = 0; i < fields; ++i) out.emplace_back(layout_.voxels());
  return out;
}

// A slab's primal step needs the new duals of the slabs before and behind it. Within a chunk of slabs it
// follows right after, while the duals are in the cache; slabs at the chunks' borders follow in a second
// round.
void Differences::iterate(Team& team, const GuardedVolume& x_bar, const Ascent& gradient,
                          const Ascent& hessian, const PrimalStep& descent) const {
  const PriorShape s = shape();
  const auto gradient_fields = fields_of<kGradient>(gradient.dual);
  const auto hessian_fields = fields_of<kHessian>(hessian.dual);
  const PriorDuals duals = {gradient.dual.empty() ? nullptr : &gradient_fields,
                            hessian.dual.empty() ? nullptr : &hessian_fields};
  constexpr int kChunks = 8;  // a multiple of what small machines have cores
  const int nz = layout_.nz, chunk = (nz + kChunks - 1) / kChunks, chunks = (nz + chunk - 1) / chunk;
  const auto first = [&](std::size_t c) { return static_cast<int>(c) * chunk; };
  const auto last = [&](std::size_t c) { return std::min(nz, first(c) + chunk) - 1; };
  const auto is_inner = [&](std::size_t c, int z) {
    return (z > first(c) || z == 0) && (z < last(c) || z + 1 == nz);
  };
  team.run(static_cast<std::size_t>(chunks), [&](std::size_t c) {
    for (int z = first(c); z <= last(c); ++z) {
      if (duals.gradient) ascend_gradient(s, z, x_bar.data(), gradient.step, *duals.gradient);
      if (duals.hessian) ascend_hessian(s, z, x_bar.data(), hessian.step, *duals.hessian);
      if (z > first(c) && is_inner(c, z - 1)) descend(s, z - 1, duals, descent);
    }
    if (is_inner(c, last(c))) descend(s, last(c), duals, descent);
  });
  team.run(static_cast<std::size_t>(chunks), [&](std::size_t c) {
    if (!is_inner(c, first(c))) descend(s, first(c), duals, descent);
    if (last(c) > first(c) && !is_inner(c, last(c))) descend(s, last(c), duals, descent);
  });
}

void Differences::adjoint(Team& team, Dual& gradient, Dual& hessian, GuardedVolume& out) const {
  const auto gradient_fields = fields_of<kGradient>(gradient);
  const auto hessian_fields = fields_of<kHessian>(hessian);
  const PriorDuals duals = {gradient.empty() ? nullptr : &gradient_fields,
                            hessian.empty() ? nullptr : &hessian_fields};
  team.run(static_cast<std::size_t>(layout_.nz),
           [&](std::size_t z) { apply_adjoint(shape(), static_cast<int>(z), duals, out.data()); });
}

double Differences::gradient_norm(Team& team, const GuardedVolume& x) const {
  std::vector<double> slabs(static_cast<std::size_t>(layout_.nz));
  team.run(slabs.size(), [&](std::size_t z) {
    slabs[z] = flamefield::gradient_norm(shape(), static_cast<int>(z), x.data());
  });
  return sum(slabs);
}

double Differences::hessian_norm(Team& team, const GuardedVolume& x) const {
  std::vector<double> slabs(static_cast<std::size_t>(layout_.nz));
  team.run(slabs.size(), [&](std::size_t z) {
    slabs[z] = flamefield::hessian_norm(shape(), static_cast<int>(z), x.data());
  });
  return sum(slabs);
}

double Differences::gradient_row() const {
  return 2 * static_cast<double>(std::max({scale_[0], scale_[1], scale_[2]}));
}
double Differences::gradient_column() const {
  return 2 * static_cast<double>(scale_[0] + scale_[1] + scale_[2]);
}
double Differences::hessian_row() const {
  const double a = scale_[0], b = scale_[1], c = scale_[2];
  return 4 * std::max({a * a, b * b, c * c, M_SQRT2 * a * b, M_SQRT2 * a * c, M_SQRT2 * b * c});
}
double Differences::hessian_column() const {
  const double a = scale_[0], b = scale_[1], c = scale_[2];
  return 4 * (a * a + b * b + c * c + M_SQRT2 * (a * b + a * c + b * c));
}

}  // namespace flamefield
