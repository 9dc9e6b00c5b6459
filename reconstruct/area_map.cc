#include "reconstruct/area_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "proto/check.h"

namespace flamefield {

namespace {

// A convex polygon; a quadrilateral cut by a square has at most eight corners.
struct Polygon {
  std::array<Eigen::Vector2d, 12> corner;
  int count = 0;

  void add(const Eigen::Vector2d& p) { corner[static_cast<std::size_t>(count++)] = p; }
  double area() const {  // shoelace
    double twice = 0;
    for (int i = 0; i < count; ++i) {
      const auto& a = corner[static_cast<std::size_t>(i)];
      const auto& b = corner[static_cast<std::size_t>(i + 1 == count ? 0 : i + 1)];
      twice += a.x() * b.y() - a.y() * b.x();
    }
    return 0.5 * std::abs(twice);
  }
};

// The part where sign * coordinate[axis] <= sign * limit (Sutherland and Hodgman 1974, one side).
Polygon cut(const Polygon& in, int axis, double limit, double sign) {
  Polygon out;
  for (int i = 0; i < in.count; ++i) {
    const auto& a = in.corner[static_cast<std::size_t>(i)];
    const auto& b = in.corner[static_cast<std::size_t>(i + 1 == in.count ? 0 : i + 1)];
    const double da = sign * (a[axis] - limit), db = sign * (b[axis] - limit);
    if (da <= 0) out.add(a);
    if ((da < 0 && db > 0) || (da > 0 && db < 0)) out.add(a + (b - a) * (da / (da - db)));
  }
  return out;
}

struct Entry {
  int x, y;
  double area;
};

int first_pixel(double low) {
  return static_cast<int>(std::floor(low + 0.5));
}

// Sensor pixels under a quadrilateral with their shared areas. False when part of it is off the sensor.
bool overlaps(const Polygon& quad, const Camera& sensor, std::vector<Entry>& out) {
  out.clear();
  Eigen::Vector2d low = quad.corner[0], high = low;
  for (int i = 0; i < quad.count; ++i) {
    const Eigen::Vector2d& p = quad.corner[static_cast<std::size_t>(i)];
    if (!p.allFinite()) return false;
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  if (!(low.x() >= -0.5 && low.y() >= -0.5 && high.x() <= sensor.image_width_px - 0.5 &&
        high.y() <= sensor.image_height_px - 0.5)) {
    return false;
  }
  const int y1 = std::min(first_pixel(high.y()), sensor.image_height_px - 1);
  for (int y = first_pixel(low.y()); y <= y1; ++y) {
    const Polygon strip = cut(cut(quad, 1, y - 0.5, -1), 1, y + 0.5, 1);
    if (strip.count < 3) continue;
    double left = INFINITY, right = -INFINITY;
    for (int i = 0; i < strip.count; ++i) {
      left = std::min(left, strip.corner[static_cast<std::size_t>(i)].x());
      right = std::max(right, strip.corner[static_cast<std::size_t>(i)].x());
    }
    const int x1 = std::min(first_pixel(right), sensor.image_width_px - 1);
    for (int x = first_pixel(left); x <= x1; ++x) {
      const double area = cut(cut(strip, 0, x - 0.5, -1), 0, x + 0.5, 1).area();
      if (area > 1e-9) out.push_back({x, y, area});
    }
  }
  return !out.empty();
}

// Where the corners of the view's pixels fall on the sensor, (rows + 1, cols + 1); NaN behind the camera and
// beyond the field where the lens model can be inverted, as its polynomial folds back there.
std::vector<Eigen::Vector2d> corners_on_sensor(const Camera& sensor, const Camera& view) {
  const Eigen::Matrix3d sensor_from_view =
      sensor.camera_from_world.rotation * view.camera_from_world.rotation.transpose();
  const Eigen::Vector2d nowhere = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  std::vector<Eigen::Vector2d> out;
  for (int row = 0; row <= view.image_height_px; ++row)
    for (int col = 0; col <= view.image_width_px; ++col) {
      const Eigen::Vector2d n = normalised_from_pixel(view, {col - 0.5, row - 0.5});
      const Eigen::Vector3d p = sensor_from_view * Eigen::Vector3d(n.x(), n.y(), 1);
      out.push_back(nowhere);
      if (!(p.z() > 0)) continue;
      const Eigen::Vector2d ideal = p.head<2>() / p.z(), pixel = pixel_from_normalised(sensor, ideal);
      if (!(pixel.cwiseAbs().maxCoeff() < 1e6)) continue;
      if (sensor.is_distorted() && !((normalised_from_pixel(sensor, pixel) - ideal).norm() < 1e-6)) continue;
      out.back() = pixel;
    }
  return out;
}

Window around(const std::vector<Entry>& entries, const Camera& sensor, int border_px) {
  if (entries.empty()) return {};
  int x0 = entries[0].x, x1 = x0, y0 = entries[0].y, y1 = y0;
  for (const Entry& e : entries) {
    x0 = std::min(x0, e.x), x1 = std::max(x1, e.x);
    y0 = std::min(y0, e.y), y1 = std::max(y1, e.y);
  }
  x0 = std::max(x0 - border_px, 0), y0 = std::max(y0 - border_px, 0);
  x1 = std::min(x1 + border_px, sensor.image_width_px - 1);
  y1 = std::min(y1 + border_px, sensor.image_height_px - 1);
  return {x0, y0, x1 - x0 + 1, y1 - y0 + 1};
}

}  // namespace

AreaMap area_map(const Camera& sensor, const Camera& view, int border_px) {
  AreaMap map;
  map.cols = view.image_width_px;
  map.rows = view.image_height_px;
  map.begin.push_back(0);
  const auto corners = corners_on_sensor(sensor, view);
  const auto corner = [&](int row, int col) {
    return corners[static_cast<std::size_t>(row) * static_cast<std::size_t>(map.cols + 1) +
                   static_cast<std::size_t>(col)];
  };
  std::vector<Entry> all, entries;
  for (int row = 0; row < map.rows; ++row)
    for (int col = 0; col < map.cols; ++col) {
      Polygon quad;
      quad.add(corner(row, col));
      quad.add(corner(row, col + 1));
      quad.add(corner(row + 1, col + 1));
      quad.add(corner(row + 1, col));
      map.is_inside.push_back(overlaps(quad, sensor, entries) ? 1 : 0);
      if (map.is_inside.back()) {
        double sum = 0;
        for (const Entry& e : entries) sum += e.area;
        for (const Entry& e : entries) map.weight.push_back(static_cast<float>(e.area / sum));
        all.insert(all.end(), entries.begin(), entries.end());
      }
      map.begin.push_back(static_cast<std::uint32_t>(all.size()));
    }
  map.window = around(all, sensor, border_px);
  for (const Entry& e : all)
    map.index.push_back(
        static_cast<std::uint32_t>((e.y - map.window.y0) * map.window.width + (e.x - map.window.x0)));
  return map;
}

AreaMap block_map(const Window& window, int binning) {
  expect(binning >= 1 && window.width >= binning && window.height >= binning, "a block fits into the window");
  AreaMap map;
  map.cols = window.width / binning;
  map.rows = window.height / binning;
  map.window = window;
  map.begin.push_back(0);
  const float weight = 1 / static_cast<float>(binning * binning);
  for (int row = 0; row < map.rows; ++row)
    for (int col = 0; col < map.cols; ++col) {
      for (int y = row * binning; y < (row + 1) * binning; ++y)
        for (int x = col * binning; x < (col + 1) * binning; ++x) {
          map.index.push_back(static_cast<std::uint32_t>(y * window.width + x));
          map.weight.push_back(weight);
        }
      map.begin.push_back(static_cast<std::uint32_t>(map.index.size()));
      map.is_inside.push_back(1);
    }
  return map;
}

AreaMap cropped(const AreaMap& map, int x0, int y0, int cols, int rows) {
  expect(x0 >= 0 && y0 >= 0 && x0 + cols <= map.cols && y0 + rows <= map.rows, "the part is in the map");
  AreaMap out;
  out.cols = cols;
  out.rows = rows;
  out.window = map.window;
  out.begin.push_back(0);
  for (int row = y0; row < y0 + rows; ++row)
    for (int col = x0; col < x0 + cols; ++col) {
      const auto pixel = static_cast<std::size_t>(row * map.cols + col);
      const auto from = static_cast<std::ptrdiff_t>(map.begin[pixel]),
                 to = static_cast<std::ptrdiff_t>(map.begin[pixel + 1]);
      out.index.insert(out.index.end(), map.index.begin() + from, map.index.begin() + to);
      out.weight.insert(out.weight.end(), map.weight.begin() + from, map.weight.begin() + to);
      out.begin.push_back(static_cast<std::uint32_t>(out.index.size()));
      out.is_inside.push_back(map.is_inside[pixel]);
    }
  return out;
}

Image AreaMap::apply(std::span<const float> sensor) const {
  expect(sensor.size() == window.pixels(), "the window's pixels are given");
  Image out(cols, rows);
  for (std::size_t pixel = 0; pixel < out.pixels.size(); ++pixel) {
    float sum = 0;
    for (std::uint32_t i = begin[pixel]; i < begin[pixel + 1]; ++i) sum += weight[i] * sensor[index[i]];
    out.pixels[pixel] = sum;
  }
  return out;
}

}  // namespace flamefield
