#include "reconstruct/projector/rectified_engine.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "proto/check.h"

namespace flamefield {

namespace {

constexpr double kOversampling = 1.25;
constexpr int kMarginPx = 3;       // of a twin's image around the box
constexpr double kSteepest = 0.8;  // sine of the elevation, above which a level twin would be too stretched

// Cubic B-spline weights of pixels -1, 0, 1, 2 at fraction f beyond pixel 0.
std::array<float, 4> cubic(float f) {
  const float g = 1 - f, sixth = 1.0f / 6;
  return {sixth * g * g * g, sixth * (4 - 3 * f * f * (2 - f)), sixth * (4 - 3 * g * g * (2 - g)),
          sixth * f * f * f};
}

// From samples to spline coefficients: the inverse of sampling the spline, (1 4 1) / 6, is the symmetric
// filter sqrt(3) z^|k|, z = sqrt(3) - 2, cut off where it falls below a thousandth. Its own transpose.
constexpr int kReach = 5;
constexpr std::array<float, kReach + 1> kPrefilter = [] {
  std::array<float, kReach + 1> out = {};
  double value = 1.7320508075688772, sum = 0;
  for (int k = 0; k <= kReach; ++k, value *= -0.2679491924311227) {
    out[static_cast<std::size_t>(k)] = static_cast<float>(value);
    sum += (k > 0 ? 2 : 1) * value;
  }
  for (float& v : out) v = static_cast<float>(v / sum);
  return out;
}();

// Both ways through an image of `lines` lines of `line` pixels, zero beyond.
void prefilter(float* image, std::size_t lines, std::size_t line) {
  std::vector<float> padded(line + 2 * kReach, 0.0f), along(lines * line);
  for (std::size_t j = 0; j < lines; ++j) {
    std::copy(image + j * line, image + (j + 1) * line, padded.begin() + kReach);
    const float* from = padded.data() + kReach;
    float* to = along.data() + j * line;
    for (std::size_t p = 0; p < line; ++p) to[p] = kPrefilter[0] * from[p];
    for (int k = 1; k <= kReach; ++k) {
      const float c = kPrefilter[static_cast<std::size_t>(k)];
      const float *below = from - k, *above = from + k;
      for (std::size_t p = 0; p < line; ++p) to[p] += c * (below[p] + above[p]);
    }
  }
  for (std::size_t j = 0; j < lines; ++j) {
    const float* centre = along.data() + j * line;
    float* to = image + j * line;
    for (std::size_t p = 0; p < line; ++p) to[p] = kPrefilter[0] * centre[p];
    for (std::size_t k = 1; k <= kReach; ++k) {
      const float c = kPrefilter[k];
      if (j >= k) {
        const float* left = centre - k * line;
        for (std::size_t p = 0; p < line; ++p) to[p] += c * left[p];
      }
      if (j + k < lines) {
        const float* right = centre + k * line;
        for (std::size_t p = 0; p < line; ++p) to[p] += c * right[p];
      }
    }
  }
}

// Upright rotation with the optical axis in the horizontal plane, nearest to the camera's.
Eigen::Matrix3d upright(const Camera& camera) {
  Eigen::Vector3d forward = camera.camera_from_world.rotation.row(2);
  forward.y() = 0;
  forward.normalize();
  const Eigen::Vector3d down(0, -1, 0), right = down.cross(forward);
  Eigen::Matrix3d out;
  out << right.transpose(), down.transpose(), forward.transpose();
  return out;
}

// Twins of one image size, the largest any of them needs.
std::vector<Camera> twins_of(const Rig& rig, const Grid& grid) {
  std::vector<Camera> out;
  int width = 1, height = 1;
  for (const Camera& c : rig.cameras) {
    out.push_back(level_twin(c, grid, kOversampling));
    width = std::max(width, out.back().image_width_px);
    height = std::max(height, out.back().image_height_px);
  }
  for (Camera& c : out) {
    c.image_width_px = width;
    c.image_height_px = height;
  }
  return out;
}

std::vector<LevelView> views_of(const Rig& rig, const std::vector<Camera>& twins, const Grid& grid,
                                std::vector<PixelModel> models) {
  std::vector<LevelView> out;
  for (std::size_t v = 0; v < twins.size(); ++v) {
    models[v].pixel_px = twins[v].fx_px / std::sqrt(rig.cameras[v].fx_px * rig.cameras[v].fy_px);
    out.emplace_back(twins[v], grid, models[v]);
  }
  return out;
}

}  // namespace

Camera level_twin(const Camera& camera, const Grid& grid, double oversampling) {
  Camera twin;
  twin.name = camera.name;
  twin.camera_from_world.rotation = upright(camera);
  twin.camera_from_world.translation_mm = -(twin.camera_from_world.rotation * camera.centre_mm());
  twin.fx_px = twin.fy_px = oversampling * std::sqrt(camera.fx_px * camera.fy_px);
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d which(corner & 1, corner >> 1 & 1, corner >> 2);
    const Eigen::Vector3d at = grid.lower_mm() + which.cwiseProduct(grid.upper_mm() - grid.lower_mm());
    const Eigen::Vector3d p = twin.camera_from_world * at;
    const Eigen::Vector2d pixel = twin.fx_px * p.head<2>() / std::max(p.z(), 1e-3);
    low = low.cwiseMin(pixel);
    high = high.cwiseMax(pixel);
  }
  const Eigen::Vector2d size = ((high - low).array() + 2 * kMarginPx + 1).ceil().cwiseMin(1e5);
  twin.image_width_px = static_cast<int>(size.x());
  twin.image_height_px = static_cast<int>(size.y());
  twin.cx_px = kMarginPx - low.x();
  twin.cy_px = kMarginPx - low.y();
  return twin;
}

std::string RectifiedEngine::obstacle(const Rig& rig, const Grid& grid,
                                      const std::vector<PixelModel>& models) {
  for (const Camera& c : rig.cameras) {
    if (std::abs(c.camera_from_world.rotation(2, 1)) > kSteepest)
      return concat("camera ", c.name, " looks up or down too steeply");
  }
  return LevelEngine::obstacle(views_of(rig, twins_of(rig, grid), grid, models));
}

RectifiedEngine::RectifiedEngine(const Rig& rig, const Grid& grid, const Layout& layout,
                                 const std::vector<PixelModel>& models)
    : cameras_(rig.cameras),
      twin_cameras_(twins_of(rig, grid)),
      layout_(layout),
      twin_layout_(grid, layout.views, twin_cameras_.front().image_height_px,
                   twin_cameras_.front().image_width_px),
      twins_(std::make_unique<LevelEngine>(views_of(rig, twin_cameras_, grid, models), twin_layout_)),
      samples_(layout.pixels()) {
  for (int v = 0; v < layout.views; ++v)
    for (int row = 0; row < layout.rows; ++row)
      for (int col = 0; col < layout.cols; ++col)
        samples_[layout.pixel(v, row, col)] = sample_of(static_cast<std::size_t>(v), row, col);
}

RectifiedEngine::Sample RectifiedEngine::sample_of(std::size_t view, int row, int col) const {
  const Camera& twin = twin_cameras_[view];
  const Ray ray = pixel_ray(cameras_[view], Eigen::Vector2d(col, row));
  const Eigen::Vector3d d = twin.camera_from_world.rotation * ray.direction;
  if (d.z() <= 0) return {};
  const double x = twin.cx_px + twin.fx_px * d.x() / d.z();
  const double up = twin_layout_.rows - 1 - (twin.cy_px + twin.fy_px * d.y() / d.z());
  if (!(x >= 1 && x < twin_layout_.cols - 2 && up >= 1 && up < twin_layout_.rows - 2)) return {};
  const double x0 = std::floor(x), up0 = std::floor(up);
  const std::size_t corner =
      (static_cast<std::size_t>(x0) - 1) * twin_layout_.line + static_cast<std::size_t>(up0) - 1;
  return {static_cast<std::int32_t>(corner), static_cast<float>(x - x0), static_cast<float>(up - up0)};
}

void RectifiedEngine::forward(Team& team, std::span<const std::size_t> views, const Planes& planes,
                              std::span<const float> volume, std::span<float> projections) const {
  std::vector<float> images(twin_layout_.pixels());
  twins_->forward(team, views, planes, volume, images);
  team.run(views.size(), [&](std::size_t i) {
    prefilter(images.data() + views[i] * twin_layout_.pixels_per_view(),
              static_cast<std::size_t>(twin_layout_.cols), twin_layout_.line);
  });
  const auto cols = static_cast<std::size_t>(layout_.cols);
  team.run_ranges(views.size() * cols, 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t view = views[i / cols];
      const float* image = images.data() + view * twin_layout_.pixels_per_view();
      const std::size_t line = view * layout_.pixels_per_view() + i % cols * layout_.line;
      for (std::size_t p = line; p < line + layout_.line; ++p) {
        const Sample& s = samples_[p];
        projections[p] = 0;
        if (s.corner < 0) continue;
        const auto across = cubic(s.right), along = cubic(s.up);
        float sum = 0;
        for (std::size_t j = 0; j < 4; ++j) {
          const float* c = image + s.corner + j * twin_layout_.line;
          sum += across[j] * (along[0] * c[0] + along[1] * c[1] + along[2] * c[2] + along[3] * c[3]);
        }
        projections[p] = sum;
      }
    }
  });
}

void RectifiedEngine::adjoint(Team& team, std::span<const std::size_t> views,
                              std::span<const float> projections, const Planes& planes,
                              std::span<float> volume) const {
  std::vector<float> images(twin_layout_.pixels(), 0.0f);
  team.run(views.size(), [&](std::size_t i) {
    const std::size_t view = views[i];
    float* image = images.data() + view * twin_layout_.pixels_per_view();
    const std::size_t first = view * layout_.pixels_per_view();
    for (std::size_t p = first; p < first + layout_.pixels_per_view(); ++p) {
      const Sample& s = samples_[p];
      if (s.corner < 0) continue;
      const auto across = cubic(s.right), along = cubic(s.up);
      for (std::size_t j = 0; j < 4; ++j) {
        float* c = image + s.corner + j * twin_layout_.line;
        const float value = across[j] * projections[p];
        for (std::size_t k = 0; k < 4; ++k) c[k] += value * along[k];
      }
    }
    prefilter(image, static_cast<std::size_t>(twin_layout_.cols), twin_layout_.line);
  });
  twins_->adjoint(team, views, images, planes, volume);
}

void RectifiedEngine::column(std::size_t voxel, std::vector<ColumnEntry>& entries) const {
  std::vector<ColumnEntry> in_twins;
  twins_->column(voxel, in_twins);
  const auto per_view = static_cast<std::uint32_t>(twin_layout_.rows * twin_layout_.cols);
  const auto twin_cols = static_cast<std::uint32_t>(twin_layout_.cols);
  for (auto from = in_twins.begin(); from != in_twins.end();) {
    const std::uint32_t view = from->pixel / per_view;
    const auto to =
        std::find_if(from, in_twins.end(), [&](const ColumnEntry& e) { return e.pixel / per_view != view; });
    // The part of the twin's image that the voxel lights.
    int left = twin_layout_.cols, right = -1, top = twin_layout_.rows, bottom = -1;
    for (auto e = from; e != to; ++e) {
      const int row = static_cast<int>(e->pixel % per_view / twin_cols),
                col = static_cast<int>(e->pixel % twin_cols);
      left = std::min(left, col), right = std::max(right, col);
      top = std::min(top, row), bottom = std::max(bottom, row);
    }
    left -= kReach, right += kReach, top -= kReach, bottom += kReach;
    const int width = right - left + 1, height = bottom - top + 1;
    std::vector<float> lit(static_cast<std::size_t>(width * height), 0.0f);
    for (auto e = from; e != to; ++e) {
      const int row = static_cast<int>(e->pixel % per_view / twin_cols) - top,
                col = static_cast<int>(e->pixel % twin_cols) - left;
      lit[static_cast<std::size_t>(row * width + col)] = e->weight;
    }
    prefilter(lit.data(), static_cast<std::size_t>(height), static_cast<std::size_t>(width));
    // The camera's pixels that may be interpolated from it.
    const Camera &camera = cameras_[view], &twin = twin_cameras_[view];
    double x0 = 1e9, x1 = -1e9, y0 = 1e9, y1 = -1e9;
    for (int i = 0; i < 9; ++i) {
      const Eigen::Vector2d at(left - 3 + (width + 5) * (i % 3) / 2.0,
                               top - 3 + (height + 5) * (i / 3) / 2.0);
      const Ray ray = pixel_ray(twin, at);
      const Eigen::Vector3d d = camera.camera_from_world.rotation * ray.direction;
      if (d.z() <= 0) continue;
      const Eigen::Vector2d p = pixel_from_normalised(camera, d.head<2>() / d.z());
      x0 = std::min(x0, p.x()), x1 = std::max(x1, p.x());
      y0 = std::min(y0, p.y()), y1 = std::max(y1, p.y());
    }
    const int from_row = std::max(0, static_cast<int>(std::floor(y0)) - 1),
              to_row = std::min(layout_.rows - 1, static_cast<int>(std::ceil(y1)) + 1),
              from_col = std::max(0, static_cast<int>(std::floor(x0)) - 1),
              to_col = std::min(layout_.cols - 1, static_cast<int>(std::ceil(x1)) + 1);
    for (int row = from_row; row <= to_row; ++row)
      for (int col = from_col; col <= to_col; ++col) {
        const Sample& s = samples_[layout_.pixel(static_cast<int>(view), row, col)];
        if (s.corner < 0) continue;
        const int corner_col = s.corner / static_cast<int>(twin_layout_.line) - left,
                  corner_row = twin_layout_.rows - 1 - s.corner % static_cast<int>(twin_layout_.line) - top;
        const auto across = cubic(s.right), along = cubic(s.up);
        float weight = 0;
        for (int j = 0; j < 4; ++j)
          for (int k = 0; k < 4; ++k) {
            const int u = corner_col + j, v = corner_row - k;
            if (u < 0 || u >= width || v < 0 || v >= height) continue;
            weight += across[static_cast<std::size_t>(j)] * along[static_cast<std::size_t>(k)] *
                      lit[static_cast<std::size_t>(v * width + u)];
          }
        if (weight == 0) continue;
        const std::size_t pixel = (static_cast<std::size_t>(view) * static_cast<std::size_t>(layout_.rows) +
                                   static_cast<std::size_t>(row)) *
                                      static_cast<std::size_t>(layout_.cols) +
                                  static_cast<std::size_t>(col);
        entries.push_back({static_cast<std::uint32_t>(pixel), weight});
      }
    from = to;
  }
}

}  // namespace flamefield
