#include "reconstruct/metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "proto/check.h"

namespace flamefield {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Sums from which all pixel-wise measures follow. R: reconstruction, P: truth.
struct Sums {
  double n = 0, r = 0, p = 0, rr = 0, pp = 0, rp = 0, distance = 0, size = 0;

  void add(double rv, double pv) {
    n += 1;
    r += rv;
    p += pv;
    rr += rv * rv;
    pp += pv * pv;
    rp += rv * pv;
    distance += std::abs(rv - pv);
    size += std::abs(pv);
  }
  void add(const Sums& o) {
    n += o.n, r += o.r, p += o.p, rr += o.rr, pp += o.pp, rp += o.rp;
    distance += o.distance, size += o.size;
  }
  double pearson() const {
    const double vr = rr - r * r / n, vp = pp - p * p / n;
    // A constant slice leaves rounding noise instead of zero.
    if (!(vr > 1e-12 * rr) || !(vp > 1e-12 * pp)) return kNone;
    return std::clamp((rp - r * p / n) / std::sqrt(vr * vp), -1.0, 1.0);
  }
  double sqmd() const { return size > 0 ? (distance / size) * (distance / size) : kNone; }
};

// Wang et al. 2004 with uniform windows and sample covariances, K1 = 0.01, K2 = 0.03.
double ssim_of_slice(const Volume& truth, const Volume& reconstruction, int y, double range) {
  const Grid& g = truth.grid;
  const int wx = std::min(7, g.nx), wz = std::min(7, g.nz);
  const double c1 = std::pow(0.01 * range, 2), c2 = std::pow(0.03 * range, 2);
  double sum = 0, windows = 0;
  for (int z0 = 0; z0 + wz <= g.nz; ++z0)
    for (int x0 = 0; x0 + wx <= g.nx; ++x0) {
      Sums s;
      for (int z = z0; z < z0 + wz; ++z)
        for (int x = x0; x < x0 + wx; ++x) s.add(reconstruction.at(x, y, z), truth.at(x, y, z));
      const double mr = s.r / s.n, mp = s.p / s.n, k = 1 / std::max(s.n - 1, 1.0);
      const double vr = (s.rr - s.n * mr * mr) * k, vp = (s.pp - s.n * mp * mp) * k,
                   c = (s.rp - s.n * mr * mp) * k;
      sum += (2 * mr * mp + c1) * (2 * c + c2) / ((mr * mr + mp * mp + c1) * (vr + vp + c2));
      windows += 1;
    }
  return sum / windows;
}

Result<> check_finite(const Volume& volume) {
  const auto bad = std::ranges::find_if_not(volume.values, [](float v) { return std::isfinite(v); });
  if (bad == volume.values.end()) return {};
  const std::ptrdiff_t i = bad - volume.values.begin();
  const Grid& g = volume.grid;
  return invalid_input(
      concat("voxel x=", i % g.nx, ", y=", i / g.nx % g.ny, ", z=", i / g.nx / g.ny, " is ", *bad),
      "no measure is defined with it", "reconstruct again, or repair the volume");
}

}  // namespace

Result<FieldMetrics> compare(const Volume& truth, const Volume& reconstruction) {
  const Grid &g = truth.grid, &h = reconstruction.grid;
  const double tolerance = 1e-6 * g.spacing_mm.maxCoeff();
  if (g.nx != h.nx || g.ny != h.ny || g.nz != h.nz || !((g.spacing_mm - h.spacing_mm).norm() <= tolerance) ||
      !((g.origin_mm - h.origin_mm).norm() <= 1e3 * tolerance)) {
    return invalid_input(
        concat("truth of ", g.nx, "x", g.ny, "x", g.nz, " voxels at ", g.origin_mm.transpose(),
               " mm, volume of ", h.nx, "x", h.ny, "x", h.nz, " at ", h.origin_mm.transpose(), " mm"),
        "only equal grids can be compared voxel by voxel", "resample one to the other's grid");
  }
  if (truth.values.size() != g.voxels() || reconstruction.values.size() != g.voxels()) {
    return invalid_input(concat(truth.values.size(), " and ", reconstruction.values.size(), " values for ",
                                g.voxels(), " voxels"),
                         "every voxel needs one", "read the volumes again");
  }
  for (const Volume* volume : {&truth, &reconstruction})
    if (auto ok = check_finite(*volume); !ok) return tl::unexpected(ok.error());
  const std::array<int, 3> size = {g.nx, g.ny, g.nz};
  std::array<std::vector<Sums>, 3> slices;
  for (std::size_t a = 0; a < 3; ++a) slices[a].resize(static_cast<std::size_t>(size[a]));
  double error = 0, peak = 0;
  for (int z = 0; z < g.nz; ++z)
    for (int y = 0; y < g.ny; ++y)
      for (int x = 0; x < g.nx; ++x) {
        const double p = truth.at(x, y, z), r = reconstruction.at(x, y, z);
        slices[0][static_cast<std::size_t>(x)].add(r, p);
        slices[1][static_cast<std::size_t>(y)].add(r, p);
        slices[2][static_cast<std::size_t>(z)].add(r, p);
        error += (r - p) * (r - p);
        peak = std::max(peak, p);
      }
  FieldMetrics out;
  Sums all;
  for (const Sums& s : slices[2]) all.add(s);
  out.pearson = all.pearson();
  out.sqmd = all.sqmd();
  out.rmse = std::sqrt(error / all.n);
  out.psnr_db = peak > 0 ? 20 * std::log10(peak / out.rmse) : kNone;
  out.ssim = peak > 0 ? 0 : kNone;
  for (int y = 0; y < g.ny && peak > 0; ++y) out.ssim += ssim_of_slice(truth, reconstruction, y, peak) / g.ny;
  for (std::size_t a = 0; a < 3; ++a)
    for (int i = 0; i < size[a]; ++i) {
      const Sums& s = slices[a][static_cast<std::size_t>(i)];
      out.slices[a].push_back({i, s.pearson(), s.sqmd()});
    }
  return out;
}

double mean_sqmd(const Projections& reference, const Projections& rendered) {
  expect(reference.values.size() == rendered.values.size() && reference.views() == rendered.views(),
         "images of one shape are compared");
  double sum = 0, lit = 0;
  for (std::size_t v = 0; v < reference.views(); ++v) {
    Sums s;
    for (std::size_t i = 0; i < reference.pixels_per_view(); ++i)
      s.add(rendered.view(v)[i], reference.view(v)[i]);
    if (!(s.size > 0)) continue;
    sum += s.sqmd();
    lit += 1;
  }
  return lit > 0 ? sum / lit : kNone;
}

std::vector<double> residual_per_view(const Projections& reference, const Projections& rendered) {
  expect(reference.values.size() == rendered.values.size() && reference.views() == rendered.views(),
         "images of one shape are compared");
  std::vector<double> out;
  for (std::size_t v = 0; v < reference.views(); ++v) {
    double difference = 0, size = 0;
    for (std::size_t i = 0; i < reference.pixels_per_view(); ++i) {
      const double b = reference.view(v)[i], d = rendered.view(v)[i] - b;
      difference += d * d;
      size += b * b;
    }
    out.push_back(size > 0         ? std::sqrt(difference / size)
                  : difference > 0 ? std::numeric_limits<double>::infinity()
                                   : 0);
  }
  return out;
}

}  // namespace flamefield
