#include "reconstruct/variational/differences.h"

#include <algorithm>
#include <cmath>

#include "proto/check.h"

namespace flamefield {

namespace {

// Pointers to the fields of a dual, for the kernels.
template <std::size_t kFields>
std::array<float*, kFields> fields_of(Differences::Dual& dual) {
  std::array<float*, kFields> out = {};
  for (std::size_t i = 0; i < dual.size(); ++i) out[i] = dual[i].data();
  return out;
}

}  // namespace

Differences::Differences(const Share& share, const Layout& layout)
    : share_(share),
      layout_(layout),
      stored_(layout),
      below_top_(layout.column + 16, 0.0f),
      zeros_(layout.column + 32, 0.0f) {
  expect(layout.nz == share.planes().count(), "the layout is of the planes held");
  held_.begin = share.has_before() ? 1 : 0;
  held_.end = held_.begin + layout.nz;
  stored_.nz = held_.end + (share.has_behind() ? 1 : 0);
  const Eigen::Vector3d spacing_mm = share.whole().spacing_mm;
  const double h = spacing_mm.minCoeff();
  for (std::size_t axis = 0; axis < 3; ++axis)
    scale_[axis] = static_cast<float>(h / spacing_mm[static_cast<Eigen::Index>(axis)]);
  for (int y = 0; y + 1 < layout.ny; ++y) below_top_[static_cast<std::size_t>(y) + 1] = 1;
}

PriorShape Differences::shape() const {
  return {layout_.nx, stored_.nz, layout_.column, scale_, below_top_.data() + 1, zeros_.data() + 16};
}

Differences::Dual Differences::make_dual(std::size_t fields) const {
  Dual out;
  for (std::size_t i = 0; i < fields; ++i) out.push_back(make_field());
  return out;
}

void Differences::pass_behind(GuardedVolume& field) const {
  const std::span<float> all = field.span();
  share_.pass_behind(held(field).last(plane()), all.first(before()));
}
void Differences::pass_before(GuardedVolume& field) const {
  const std::span<float> all = field.span();
  share_.pass_before(held(field).first(plane()), all.subspan(before() + layout_.voxels()));
}
void Differences::complete(GuardedVolume& field) const {
  pass_behind(field);
  pass_before(field);
}

// What the adjoints look at beyond a plane: of forward differences the plane before, of second ones both.
void Differences::complete_duals(Dual& gradient, Dual& hessian) const {
  if (!gradient.empty()) pass_behind(gradient[2]);
  if (hessian.empty()) return;
  complete(hessian[2]);
  pass_behind(hessian[4]);
  pass_behind(hessian[5]);
}

// A plane's primal step needs the new duals of the planes before and behind it. Within a chunk of planes it
// follows right after, while the duals are in the cache; planes at the chunks' borders follow in a second
// round.
void Differences::iterate(Team& team, GuardedVolume& x_bar, const Ascent& gradient, const Ascent& hessian,
                          PrimalStep descent) const {
  const PriorShape s = shape();
  const auto gradient_fields = fields_of<kGradient>(gradient.dual);
  const auto hessian_fields = fields_of<kHessian>(hessian.dual);
  const PriorDuals duals = {gradient.dual.empty() ? nullptr : &gradient_fields,
                            hessian.dual.empty() ? nullptr : &hessian_fields};
  descent.before = before();
  constexpr int kChunks = 8;  // a multiple of what small machines have cores
  const int nz = layout_.nz, chunk = (nz + kChunks - 1) / kChunks, chunks = (nz + chunk - 1) / chunk;
  const auto first = [&](std::size_t c) { return held_.begin + static_cast<int>(c) * chunk; };
  const auto last = [&](std::size_t c) { return std::min(held_.end, first(c) + chunk) - 1; };
  const auto is_inner = [&](std::size_t c, int z) {
    return (z > first(c) || z == 0) && (z < last(c) || z + 1 == stored_.nz);
  };
  complete(x_bar);
  team.run(static_cast<std::size_t>(chunks), [&](std::size_t c) {
    for (int z = first(c); z <= last(c); ++z) {
      if (duals.gradient) ascend_gradient(s, z, x_bar.data(), gradient.step, *duals.gradient);
      if (duals.hessian) ascend_hessian(s, z, x_bar.data(), hessian.step, *duals.hessian);
      if (z > first(c) && is_inner(c, z - 1)) descend(s, z - 1, duals, descent);
    }
    if (is_inner(c, last(c))) descend(s, last(c), duals, descent);
  });
  complete_duals(gradient.dual, hessian.dual);
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
  team.run(static_cast<std::size_t>(layout_.nz), [&](std::size_t i) {
    apply_adjoint(shape(), held_.begin + static_cast<int>(i), duals, out.data());
  });
}

double Differences::gradient_norm(Team& team, GuardedVolume& x) const {
  complete(x);
  std::vector<double> planes(static_cast<std::size_t>(layout_.nz));
  team.run(planes.size(), [&](std::size_t i) {
    planes[i] = flamefield::gradient_norm(shape(), held_.begin + static_cast<int>(i), x.data());
  });
  return share_.sum(planes);
}

double Differences::hessian_norm(Team& team, GuardedVolume& x) const {
  complete(x);
  std::vector<double> planes(static_cast<std::size_t>(layout_.nz));
  team.run(planes.size(), [&](std::size_t i) {
    planes[i] = flamefield::hessian_norm(shape(), held_.begin + static_cast<int>(i), x.data());
  });
  return share_.sum(planes);
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
