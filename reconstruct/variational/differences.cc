#include "reconstruct/variational/differences.h"

#include <cmath>

namespace flamefield {

namespace {

constexpr float kSqrt2 = 1.41421356f;

// The columns around column (x, z), replaced by itself or the nearest where the box ends.
struct Around {
  const float *at, *left, *right, *front, *back, *right_back;

  Around(const Layout& l, const float* v, int x, int z) {
    const int xl = x > 0 ? x - 1 : x, xr = x + 1 < l.nx ? x + 1 : x;
    const int zf = z > 0 ? z - 1 : z, zb = z + 1 < l.nz ? z + 1 : z;
    at = v + l.voxel(x, 0, z);
    left = v + l.voxel(xl, 0, z);
    right = v + l.voxel(xr, 0, z);
    front = v + l.voxel(x, 0, zf);
    back = v + l.voxel(x, 0, zb);
    right_back = v + l.voxel(xr, 0, zb);
  }
};

struct Hessian {
  float xx, yy, zz, xy, xz, yz;
  float norm() const { return std::sqrt(xx * xx + yy * yy + zz * zz + xy * xy + xz * xz + yz * yz); }
};

// s: first-difference scales; top: 1 where y + 1 exists, top_before the same for y - 1
inline Hessian hessian_at(const Around& v, std::size_t y, const std::array<float, 3>& s, float top,
                          float top_before) {
  const float c = v.at[y], up = top * (v.at[y + 1] - c), down = top_before * (c - v.at[y - 1]);
  return {s[0] * s[0] * (v.left[y] + v.right[y] - 2 * c),
          s[1] * s[1] * (up - down),
          s[2] * s[2] * (v.front[y] + v.back[y] - 2 * c),
          kSqrt2 * s[0] * s[1] * (top * (v.right[y + 1] - v.right[y]) - up),
          kSqrt2 * s[0] * s[2] * (v.right_back[y] - v.right[y] - v.back[y] + c),
          kSqrt2 * s[1] * s[2] * (top * (v.back[y + 1] - v.back[y]) - up)};
}

struct Gradient {
  float x, y, z;
  float norm() const { return std::sqrt(x * x + y * y + z * z); }
};

inline Gradient gradient_at(const Around& v, std::size_t y, const std::array<float, 3>& s, float top) {
  const float c = v.at[y];
  return {s[0] * (v.right[y] - c), s[1] * top * (v.at[y + 1] - c), s[2] * (v.back[y] - c)};
}

template <class At>
double sum_of_columns(Team& team, const Layout& l, const At& at) {
  std::vector<double> slabs(static_cast<std::size_t>(l.nz), 0);
  team.run(slabs.size(), [&](std::size_t z) {
    for (int x = 0; x < l.nx; ++x)
      for (std::size_t y = 0; y < static_cast<std::size_t>(l.ny); ++y)
        slabs[z] += static_cast<double>(at(x, y, static_cast<int>(z)));
  });
  double sum = 0;
  for (const double slab : slabs) sum += slab;
  return sum;
}

}  // namespace

Differences::Differences(const Grid& grid, const Layout& layout)
    : layout_(layout), below_top_(layout.column + 1, 0.0f) {
  const double h = grid.spacing_mm.minCoeff();
  for (std::size_t axis = 0; axis < 3; ++axis)
    scale_[axis] = static_cast<float>(h / grid.spacing_mm[static_cast<Eigen::Index>(axis)]);
  for (int y = 0; y + 1 < layout.ny; ++y) below_top_[static_cast<std::size_t>(y) + 1] = 1;
}

void Differences::ascend_hessian(Team& team, const GuardedVolume& x, float step, float weight,
                                 std::span<GuardedVolume> p) const {
  team.run(static_cast<std::size_t>(layout_.nz), [&](std::size_t slab) {
    const int z = static_cast<int>(slab);
    const float* top = below_top_.data() + 1;
    for (int i = 0; i < layout_.nx; ++i) {
      const Around v(layout_, x.data(), i, z);
      const std::size_t at = layout_.voxel(i, 0, z);
      float *xx = p[0].data() + at, *yy = p[1].data() + at, *zz = p[2].data() + at;
      float *xy = p[3].data() + at, *xz = p[4].data() + at, *yz = p[5].data() + at;
#pragma GCC ivdep
      for (std::size_t y = 0; y < layout_.column; ++y) {
        const Hessian d = hessian_at(v, y, scale_, top[y], *(top + y - 1));
        const Hessian q = {xx[y] + step * d.xx, yy[y] + step * d.yy, zz[y] + step * d.zz,
                           xy[y] + step * d.xy, xz[y] + step * d.xz, yz[y] + step * d.yz};
        const float norm = q.norm(), shrink = weight / (norm > weight ? norm : weight);
        xx[y] = shrink * q.xx;
        yy[y] = shrink * q.yy;
        zz[y] = shrink * q.zz;
        xy[y] = shrink * q.xy;
        xz[y] = shrink * q.xz;
        yz[y] = shrink * q.yz;
      }
    }
  });
}

void Differences::ascend_gradient(Team& team, const GuardedVolume& x, float step, float weight,
                                  std::span<GuardedVolume> p) const {
  team.run(static_cast<std::size_t>(layout_.nz), [&](std::size_t slab) {
    const int z = static_cast<int>(slab);
    const float* top = below_top_.data() + 1;
    for (int i = 0; i < layout_.nx; ++i) {
      const Around v(layout_, x.data(), i, z);
      const std::size_t at = layout_.voxel(i, 0, z);
      float *px = p[0].data() + at, *py = p[1].data() + at, *pz = p[2].data() + at;
#pragma GCC ivdep
      for (std::size_t y = 0; y < layout_.column; ++y) {
        const Gradient d = gradient_at(v, y, scale_, top[y]);
        const Gradient q = {px[y] + step * d.x, py[y] + step * d.y, pz[y] + step * d.z};
        const float norm = q.norm(), shrink = weight / (norm > weight ? norm : weight);
        px[y] = shrink * q.x;
        py[y] = shrink * q.y;
        pz[y] = shrink * q.z;
      }
    }
  });
}

// Second differences with flat ends are their own transpose. A mixed dual is zero where its difference leaves
// the box, at the top too, so that y - 1 at the bottom of a column reads the zero top of the one before.
void Differences::add_hessian_adjoint(int z, std::span<const GuardedVolume> p, float* out) const {
  const std::vector<float> zeros(layout_.column + 32, 0.0f);
  const float* none = zeros.data() + 16;
  const float* top = below_top_.data() + 1;
  const float a = scale_[0] * scale_[0], b = scale_[1] * scale_[1], c = scale_[2] * scale_[2];
  const float ab = kSqrt2 * scale_[0] * scale_[1], ac = kSqrt2 * scale_[0] * scale_[2],
              bc = kSqrt2 * scale_[1] * scale_[2];
  for (int x = 0; x < layout_.nx; ++x) {
    const Around xx(layout_, p[0].data(), x, z), zz(layout_, p[2].data(), x, z);
    const std::size_t at = layout_.voxel(x, 0, z);
    const float *yy = p[1].data() + at, *xy = p[3].data() + at, *xz = p[4].data() + at,
                *yz = p[5].data() + at;
    const auto earlier = [&](const GuardedVolume& q, int dx, int dz) {
      return x >= dx && z >= dz ? q.data() + layout_.voxel(x - dx, 0, z - dz) : none;
    };
    const float *xy_left = earlier(p[3], 1, 0), *xz_left = earlier(p[4], 1, 0),
                *xz_front = earlier(p[4], 0, 1), *xz_both = earlier(p[4], 1, 1),
                *yz_front = earlier(p[5], 0, 1);
    float* g = out + static_cast<std::size_t>(x) * layout_.column;
#pragma GCC ivdep
    for (std::size_t y = 0; y < layout_.column; ++y) {
      const float second = a * (xx.left[y] + xx.right[y] - 2 * xx.at[y]) +
                           b * (top[y] * (yy[y + 1] - yy[y]) - *(top + y - 1) * (yy[y] - *(yy + y - 1))) +
                           c * (zz.front[y] + zz.back[y] - 2 * zz.at[y]);
      const float mixed = ab * (xy[y] - *(xy + y - 1) - xy_left[y] + *(xy_left + y - 1)) +
                          ac * (xz[y] - xz_left[y] - xz_front[y] + xz_both[y]) +
                          bc * (yz[y] - *(yz + y - 1) - yz_front[y] + *(yz_front + y - 1));
      g[y] += second + mixed;
    }
  }
}

void Differences::add_gradient_adjoint(int z, std::span<const GuardedVolume> p, float* out) const {
  const std::vector<float> zeros(layout_.column, 0.0f);
  for (int x = 0; x < layout_.nx; ++x) {
    const std::size_t at = layout_.voxel(x, 0, z);
    const float *px = p[0].data() + at, *py = p[1].data() + at, *pz = p[2].data() + at;
    const float* left = x > 0 ? p[0].data() + layout_.voxel(x - 1, 0, z) : zeros.data();
    const float* front = z > 0 ? p[2].data() + layout_.voxel(x, 0, z - 1) : zeros.data();
    float* g = out + static_cast<std::size_t>(x) * layout_.column;
#pragma GCC ivdep
    for (std::size_t y = 0; y < layout_.column; ++y) {
      g[y] += scale_[0] * (left[y] - px[y]) + scale_[1] * (*(py + y - 1) - py[y]) +
              scale_[2] * (front[y] - pz[y]);
    }
  }
}

double Differences::gradient_norm(Team& team, const GuardedVolume& v) const {
  return sum_of_columns(team, layout_, [&](int x, std::size_t y, int z) {
    return gradient_at(Around(layout_, v.data(), x, z), y, scale_, below_top_[y + 1]).norm();
  });
}

double Differences::hessian_norm(Team& team, const GuardedVolume& v) const {
  return sum_of_columns(team, layout_, [&](int x, std::size_t y, int z) {
    return hessian_at(Around(layout_, v.data(), x, z), y, scale_, below_top_[y + 1], below_top_[y]).norm();
  });
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
