#include "services/report/volume_view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "proto/check.h"
#include "services/report/slices.h"

namespace flamefield {
namespace {

constexpr int kMaxSide = 128;           // finer voxels than this are not seen in a picture
constexpr double kStepVoxels = 0.3;     // along a ray
constexpr double kOpaque = 0.99;        // rays end here
constexpr double kFirstVisible = 0.02;  // of the brightest; below it the gradient is noise
constexpr double kFieldOfView_rad = 0.5;

// Binomial 1-2-1 along each axis: trilinear interpolation of a sheet one voxel thin shows the voxels as wood
// grain; after this it is close to a quadratic B-spline.
Volume smoothed(Volume volume) {
  const Grid& g = volume.grid;
  const std::array<int, 3> size = {g.nx, g.ny, g.nz};
  const std::array<std::size_t, 3> stride = {1, g.index(0, 1, 0), g.index(0, 0, 1)};
  std::vector<float> line;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    const auto n = static_cast<std::size_t>(size[axis]);
    line.resize(n);
    for (std::size_t i = 0; i < static_cast<std::size_t>(size[u]); ++i) {
      for (std::size_t j = 0; j < static_cast<std::size_t>(size[v]); ++j) {
        float* first = volume.values.data() + i * stride[u] + j * stride[v];
        for (std::size_t k = 0; k < n; ++k) line[k] = first[k * stride[axis]];
        for (std::size_t k = 0; k < n; ++k) {
          const float before = line[k > 0 ? k - 1 : k], after = line[k + 1 < n ? k + 1 : k];
          first[k * stride[axis]] = 0.25f * before + 0.5f * line[k] + 0.25f * after;
        }
      }
    }
  }
  return volume;
}

struct Span {
  double from = 0, to = 0;
};

// Where a ray is inside the box (slab method).
Span inside_box(const Ray& ray, const Grid& grid) {
  Span span{0, 1e30};
  for (Eigen::Index a = 0; a < 3; ++a) {
    if (std::abs(ray.direction[a]) < 1e-12) {
      const bool between = ray.origin_mm[a] > grid.lower_mm()[a] && ray.origin_mm[a] < grid.upper_mm()[a];
      if (!between) return {};
      continue;
    }
    const double t0 = (grid.lower_mm()[a] - ray.origin_mm[a]) / ray.direction[a];
    const double t1 = (grid.upper_mm()[a] - ray.origin_mm[a]) / ray.direction[a];
    span.from = std::max(span.from, std::min(t0, t1));
    span.to = std::min(span.to, std::max(t0, t1));
  }
  return span;
}

// Trilinear in voxel indices, the nearest voxel beyond the outermost centres.
class Sampler {
 public:
  explicit Sampler(const Volume& volume)
      : values_(volume.values.data()),
        last_(volume.grid.nx - 1, volume.grid.ny - 1, volume.grid.nz - 1),
        stride_y_(volume.grid.nx),
        stride_z_(static_cast<std::ptrdiff_t>(volume.grid.nx) * volume.grid.ny) {}

  float operator()(const Eigen::Vector3f& at) const {
    const Eigen::Vector3f p = at.cwiseMax(0.0f).cwiseMin(last_.cast<float>());
    const Eigen::Vector3i i = p.cast<int>().cwiseMin(last_);
    const Eigen::Vector3f w = p - i.cast<float>();
    const std::ptrdiff_t dx = i.x() < last_.x(), dy = i.y() < last_.y() ? stride_y_ : 0,
                         dz = i.z() < last_.z() ? stride_z_ : 0;
    const float* v = values_ + i.z() * stride_z_ + i.y() * stride_y_ + i.x();
    const auto lerp = [](float a, float b, float t) { return a + (b - a) * t; };
    const auto plane = [&](const float* q) {
      return lerp(lerp(q[0], q[dx], w.x()), lerp(q[dy], q[dy + dx], w.x()), w.y());
    };
    return lerp(plane(v), plane(v + dz), w.z());
  }

  Eigen::Vector3f gradient(const Eigen::Vector3f& at) const {
    Eigen::Vector3f out;
    for (Eigen::Index a = 0; a < 3; ++a) {
      const Eigen::Vector3f e = Eigen::Vector3f::Unit(a);
      out[a] = (*this)(at + e) - (*this)(at - e);
    }
    return out;
  }

 private:
  const float* values_;
  Eigen::Vector3i last_;
  std::ptrdiff_t stride_y_, stride_z_;
};

struct Shade {
  Eigen::Vector3f colour = Eigen::Vector3f::Zero();  // premultiplied
  float opacity = 0;
};

struct Medium {
  Sampler sampler;
  const Grid& grid;
  float high;        // brightest emission
  float extinction;  // 1/mm at the brightest emission
  std::array<Eigen::Vector3f, 256> colours;
};

// Each pixel starts at another fraction of a step: what would be contour lines becomes faint grain. (Jimenez
// 2014, "Next generation post processing in Call of Duty", interleaved gradient noise.)
float jitter(int x, int y) {
  const double inner = 0.06711056 * x + 0.00583715 * y;
  const double outer = 52.9829189 * (inner - std::floor(inner));
  return static_cast<float>(outer - std::floor(outer));
}

Shade cast(const Medium& medium, const Ray& ray, float jitter) {
  const Span span = inside_box(ray, medium.grid);
  const float step_mm = static_cast<float>(kStepVoxels * medium.grid.spacing_mm.minCoeff());
  const Eigen::Vector3d per_voxel = medium.grid.spacing_mm.cwiseInverse();
  const Eigen::Vector3f start = (ray.origin_mm - medium.grid.origin_mm).cwiseProduct(per_voxel).cast<float>();
  const Eigen::Vector3f direction = ray.direction.cwiseProduct(per_voxel).cast<float>();
  const Eigen::Vector3f look = ray.direction.cast<float>();
  Shade out;
  for (float t = static_cast<float>(span.from) + jitter * step_mm; t < static_cast<float>(span.to);
       t += step_mm) {
    const Eigen::Vector3f at = start + t * direction;
    const float v = std::clamp(medium.sampler(at) / medium.high, 0.0f, 1.0f);
    if (v < static_cast<float>(kFirstVisible)) continue;
    const float opacity = 1 - std::exp(-medium.extinction * v * std::sqrt(v) * step_mm);
    const Eigen::Vector3f normal = medium.sampler.gradient(at) / medium.high;
    const float steepness = normal.norm();
    const float facing = steepness > 0 ? std::abs(normal.dot(look)) / steepness : 1;
    const float light = 1 - std::min(1.0f, 4 * steepness) * 0.62f * (1 - facing);
    const float weight = (1 - out.opacity) * opacity;
    out.colour += weight * light * medium.colours[static_cast<std::size_t>(110 + 140 * v)];
    out.opacity += weight;
    if (out.opacity > static_cast<float>(kOpaque)) break;
  }
  return out;
}

}  // namespace

Camera turntable_camera(const Grid& grid, const VolumeViewOptions& options) {
  const Eigen::Vector3d size = grid.upper_mm() - grid.lower_mm();
  const Eigen::Vector3d centre = 0.5 * (grid.upper_mm() + grid.lower_mm());
  const double e = options.elevation_rad, a = options.azimuth_rad;
  const double distance_mm = 0.5 * size.norm() / std::sin(0.5 * kFieldOfView_rad);
  const Eigen::Vector3d towards(std::cos(e) * std::sin(a), std::sin(e), std::cos(e) * std::cos(a));
  Camera camera;
  camera.name = "turntable";
  camera.image_width_px = options.width_px;
  camera.image_height_px = options.height_px;
  const Eigen::Vector3d forward = -towards;
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitY()).normalized();
  const Eigen::Vector3d down = forward.cross(right);
  camera.camera_from_world.rotation << right.transpose(), down.transpose(), forward.transpose();
  camera.camera_from_world.translation_mm =
      -(camera.camera_from_world.rotation * (centre + distance_mm * towards));
  // The turning box sweeps a cylinder; its two rims must fit.
  const double radius_mm = 0.5 * std::hypot(size.x(), size.z());
  double half_width = 0, low = 0, high = 0;  // tangents
  for (int i = 0; i < 64; ++i) {
    const double phi = 2 * std::numbers::pi * i / 64;
    for (double y : {-0.5, 0.5}) {
      const Eigen::Vector3d rim =
          centre + Eigen::Vector3d(radius_mm * std::cos(phi), y * size.y(), radius_mm * std::sin(phi));
      const Eigen::Vector3d p = camera.camera_from_world * rim;
      half_width = std::max(half_width, std::abs(p.x() / p.z()));
      low = std::min(low, p.y() / p.z()), high = std::max(high, p.y() / p.z());
    }
  }
  camera.fx_px = camera.fy_px =
      0.96 * std::min(0.5 * options.width_px / half_width, options.height_px / (high - low));
  camera.cx_px = 0.5 * (options.width_px - 1);
  camera.cy_px = 0.5 * (options.height_px - 1) - 0.5 * (low + high) * camera.fy_px;
  return camera;
}

RgbaImage ray_cast(const Volume& full, const Camera& camera, const VolumeViewOptions& options) {
  expect(full.values.size() == full.grid.voxels() && !full.values.empty(),
         "a volume has one value per voxel");
  const double brightest = options.high > 0 ? options.high : emission_range(full.values).high;
  const Volume volume = smoothed(reduced(full, kMaxSide));
  const Eigen::Vector3d size = volume.grid.upper_mm() - volume.grid.lower_mm();
  // What smoothing took from the peaks of thin fronts is given back, or the finest flames would be the
  // darkest.
  const double high = std::max(brightest * kFirstVisible, brightest * emission_range(volume.values).high /
                                                              emission_range(full.values).high);
  Medium medium{Sampler(volume),
                volume.grid,
                static_cast<float>(high),
                static_cast<float>(options.density / size.mean()),
                {}};
  for (std::size_t i = 0; i < 256; ++i) {
    const Rgb c = inferno()[i];
    medium.colours[i] = Eigen::Vector3f(c[0], c[1], c[2]) / 255;
  }
  RgbaImage out{camera.image_width_px, camera.image_height_px, {}};
  out.bytes.reserve(4 * static_cast<std::size_t>(out.width_px) * static_cast<std::size_t>(out.height_px));
  const auto byte = [](float v) {
    return static_cast<std::uint8_t>(std::lround(255 * std::clamp(v, 0.f, 1.f)));
  };
  for (int y = 0; y < out.height_px; ++y) {
    for (int x = 0; x < out.width_px; ++x) {
      const Shade s = cast(medium, pixel_ray(camera, {x, y}), jitter(x, y));
      const Eigen::Vector3f c = s.opacity > 0 ? Eigen::Vector3f(s.colour / s.opacity) : s.colour;
      for (float channel : {c.x(), c.y(), c.z(), s.opacity}) out.bytes.push_back(byte(channel));
    }
  }
  return out;
}

RgbImage volume_view(const Volume& volume, const VolumeViewOptions& options) {
  const RgbaImage cast = ray_cast(volume, turntable_camera(volume.grid, options), options);
  RgbImage out(cast.width_px, cast.height_px);
  for (std::size_t i = 0; i < out.bytes.size() / 3; ++i) {
    const int opacity = cast.bytes[4 * i + 3];
    for (std::size_t c = 0; c < 3; ++c) {
      const int blend = cast.bytes[4 * i + c] * opacity + options.background[c] * (255 - opacity);
      out.bytes[3 * i + c] = static_cast<std::uint8_t>((blend + 127) / 255);
    }
  }
  return out;
}

}  // namespace flamefield
