#include "reconstruct/projector/level_view.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "proto/check.h"

namespace flamefield {

bool is_level(const Camera& camera, double tolerance_px) {
  if (camera.is_distorted()) return false;
  const Eigen::Matrix3d& r = camera.camera_from_world.rotation;
  const double reach_px = std::max(
      {std::abs(camera.cx_px), std::abs(camera.cy_px), std::abs(camera.image_width_px - camera.cx_px),
       std::abs(camera.image_height_px - camera.cy_px), camera.fx_px, camera.fy_px});
  // World y in the camera's frame should be (0, -1, 0).
  return r(1, 1) < 0 && std::hypot(r(0, 1), r(2, 1)) * reach_px <= tolerance_px;
}

LevelView::LevelView(const Camera& camera, const Grid& grid, const PixelModel& model)
    : model_(model),
      origin_mm_(grid.origin_mm),
      spacing_mm_(grid.spacing_mm),
      right_(camera.camera_from_world.rotation.row(0)),
      forward_(camera.camera_from_world.rotation.row(2)),
      centre_mm_(camera.centre_mm()),
      axis_px_(camera.cx_px),
      focal_px_(static_cast<float>(camera.fx_px)),
      focal_up_px_(camera.fy_px),
      axis_up_(camera.image_height_px - 1 - camera.cy_px),
      height_((camera.centre_mm().y() - grid.origin_mm.y()) / grid.spacing_mm.y()),
      planes_along_z_(grid.nz),
      planes_along_x_(grid.nx),
      smallest_m_(std::numeric_limits<double>::infinity()),
      nearest_m_(std::numeric_limits<double>::infinity()) {
  if (model_.aperture_mm <= 0) bare_half_px_ = half_px(0);
  const Eigen::Vector3d centre = camera.centre_mm(), s = grid.spacing_mm, o = grid.origin_mm;
  const Eigen::Matrix3d& r = camera.camera_from_world.rotation;
  const Eigen::Vector3d right = r.row(0), forward = r.row(2);
  const auto push = [](Linear& out, double at0, double step) {
    out.at0.push_back(static_cast<float>(at0));
    out.step.push_back(static_cast<float>(step));
  };
  for (int col = 0; col < camera.image_width_px; ++col) {
    const double x_n = (col - camera.cx_px) / camera.fx_px;
    const Eigen::Vector3d d = forward + x_n * right;
    const bool along_z = std::abs(d.z()) * s.x() >= std::abs(d.x()) * s.z();
    const int main = along_z ? 2 : 0, other = 2 - main, planes = along_z ? grid.nz : grid.nx;
    const double depth = (o[main] - centre[main]) / d[main], per_plane = s[main] / d[main];
    // dq/dx_n = depth (right x forward) / (d_main s_other), and half a pixel is 1/2f in x_n.
    const double turn = std::abs(right[other] * forward[main] - right[main] * forward[other]);
    const double width = turn / (2 * camera.fx_px * std::abs(d[main]) * s[other]);
    const double height = 1 / (camera.fy_px * s.y());
    push(q_, (centre[other] + depth * d[other] - o[other]) / s[other], per_plane * d[other] / s[other]);
    push(half_, depth * width, per_plane * width);
    push(m_, depth * height, per_plane * height);
    push(depth_mm_, depth, per_plane);
    along_z_.push_back(along_z);
    step_mm_.push_back(s[main] / std::abs(d[main]));
    slant2_.push_back(1 + x_n * x_n);

    std::vector<Run>& runs = along_z ? runs_along_z_ : runs_along_x_;
    if (runs.empty() || runs.back().end != col) runs.push_back({col, col});
    runs.back().end = col + 1;
    note_extremes(static_cast<std::size_t>(col), planes, along_z ? grid.nx : grid.nz);
  }
  const double reach_px = std::max(axis_up_, camera.image_height_px - 1 - axis_up_);
  double most_growth = 0;
  for (float step : m_.step) most_growth = std::max<double>(most_growth, std::abs(step));
  if (model.area && most_growth / 2 * reach_px <= kMostShift_voxels) alike_ = 2;
}

// Sizes matter only where the column's lines of sight are near the box.
void LevelView::note_extremes(std::size_t col, int planes, int others) {
  constexpr float kBeyond = 3;
  for (int k = 0; k < planes; ++k) {
    const auto plane = static_cast<float>(k);
    const float q = q_.at(col, plane), m = m_.at(col, plane), pixels = 2 * half_px(depth_mm_.at(col, plane));
    nearest_m_ = std::min<double>(nearest_m_, m);
    if (q < -kBeyond || q > static_cast<float>(others) + kBeyond) continue;
    smallest_m_ = std::min<double>(smallest_m_, m);
    largest_m_ = std::max<double>(largest_m_, m);
    largest_half_ = std::max<double>({largest_half_, pixels * half_.at(col, plane), pixels * m / 2});
  }
}

// The blur circle of a thin lens, D = f A |1/depth - 1/focus| pixels across, has the variance D^2 / 16 on
// each axis; a box of width w has w^2 / 12. Pixel and circle together act like the box of equal variance.
float LevelView::half_px(float depth_mm) const {
  const float pixel_px = model_.area ? static_cast<float>(model_.pixel_px) : 0.0f;
  if (model_.aperture_mm <= 0) return 0.5f * pixel_px;
  const auto aperture_mm = static_cast<float>(model_.aperture_mm),
             focus_mm = static_cast<float>(model_.focus_mm);
  const float circle_px = focal_px_ * aperture_mm * (1 / depth_mm - 1 / focus_mm);
  return 0.5f * std::sqrt(pixel_px * pixel_px + 0.75f * circle_px * circle_px);
}

// The plane, as a fraction, whose pixel size `plane` takes.
float LevelView::middle(int plane, int planes) const {
  const int first = plane / alike_ * alike_;
  return first + 1 < planes && alike_ == 2 ? static_cast<float>(first) + 0.5f : static_cast<float>(plane);
}

StripPatch LevelView::patch(int col, int cols, int plane, int planes, Strips& out) const {
  expect(cols * planes <= kPatch && (planes == 1 || plane % alike_ == 0),
         "a patch is small and parts no planes that are alike");
  const int all = along_z(col) ? planes_along_z_ : planes_along_x_;
  float exact[kPatch], shared[kPatch];
  for (int i = 0; i < planes; ++i)
    exact[i] = static_cast<float>(plane + i), shared[i] = middle(plane + i, all);
  for (int i = 0; i < cols; ++i) {
    const auto c = static_cast<std::size_t>(col + i);
    const int first = i * planes;
    const auto line = [&](const Linear& linear, const float* at, float* values) {
      const float at0 = linear.at0[c], step = linear.step[c];
      for (int k = 0; k < planes; ++k) values[first + k] = at0 + at[k] * step;
    };
    line(q_, exact, out.q);
    line(half_, exact, out.half);
    line(m_, shared, out.m);
    if (model_.aperture_mm > 0) line(depth_mm_, shared, out.half_px);
  }
  for (int i = 0; i < cols * planes; ++i) {
    out.half_px[i] = model_.aperture_mm > 0 ? half_px(out.half_px[i]) : bare_half_px_;
    out.half[i] *= 2 * out.half_px[i];
  }
  StripPatch patch;
  patch.cols = cols, patch.planes = planes;
  patch.q = out.q, patch.half = out.half, patch.m = out.m, patch.half_px = out.half_px;
  patch.alike = alike_;
  return patch;
}

LevelView::Run LevelView::near(int x, int z) const {
  double low = cols(), high = -1;
  // A voxel reaches one spacing to each side, the average over a pixel some more; half a voxel beyond the
  // faces.
  const double reach = 1.5 + largest_half_;
  for (const double dx : {-reach, reach})
    for (const double dz : {-reach, reach}) {
      Eigen::Vector3d at = origin_mm_ - centre_mm_;
      at.x() += (x + dx) * spacing_mm_.x();
      at.z() += (z + dz) * spacing_mm_.z();
      const double depth = std::max(1e-3, forward_.dot(at));
      const double col = axis_px_ + focal_px_ * right_.dot(at) / depth;
      low = std::min(low, col);
      high = std::max(high, col);
    }
  const auto inside = [&](double col) {
    return static_cast<int>(std::clamp(col, 0.0, static_cast<double>(cols())));
  };
  return {inside(std::floor(low)), inside(std::ceil(high) + 1)};
}

float LevelView::length_mm(int col, int up) const {
  const auto c = static_cast<std::size_t>(col);
  const double y_n = (up - axis_up_) / focal_up_px_;
  return static_cast<float>(step_mm_[c] * std::sqrt(slant2_[c] + y_n * y_n));
}

}  // namespace flamefield
