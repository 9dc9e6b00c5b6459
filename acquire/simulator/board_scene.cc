#include "acquire/simulator/board_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace flamefield {

namespace {

constexpr int kSamples = 3;  // a side of a pixel; each sample is area-filtered once more (see Stripes)

struct Region {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // [x0, x1) x [y0, y1)
};

// Axis-aligned box of pixels that the plate may touch, blur included; none when it is out of sight.
std::optional<Region> plate_region(const Camera& camera, const Rigid3& world_from_board, double half_u_mm,
                                   double half_v_mm, double margin_px) {
  double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9;
  constexpr int kSteps = 8;  // along each edge: a distorted edge is not straight
  for (int i = 0; i <= kSteps; ++i) {
    const double t = 2.0 * i / kSteps - 1.0;
    for (const auto& [a, b] :
         {std::array{t, -1.0}, std::array{t, 1.0}, std::array{-1.0, t}, std::array{1.0, t}}) {
      const auto pixel = project(camera, world_from_board * Eigen::Vector3d(a * half_u_mm, b * half_v_mm, 0));
      if (!pixel) return std::nullopt;
      x0 = std::min(x0, pixel->x());
      x1 = std::max(x1, pixel->x());
      y0 = std::min(y0, pixel->y());
      y1 = std::max(y1, pixel->y());
    }
  }
  const auto clip = [](double v, int size) { return static_cast<int>(std::clamp(v, 0.0, double(size))); };
  const Region region{clip(std::floor(x0 - margin_px), camera.image_width_px),
                      clip(std::floor(y0 - margin_px), camera.image_height_px),
                      clip(std::ceil(x1 + margin_px) + 1, camera.image_width_px),
                      clip(std::ceil(y1 + margin_px) + 1, camera.image_height_px)};
  if (region.x0 >= region.x1 || region.y0 >= region.y1) return std::nullopt;
  return region;
}

// One axis of the board, averaged over an interval [at - width / 2, at + width / 2] of it. The pattern is
// separable, parity = stripes(u) * stripes(v), so filtering each axis is an area filter of one sample.
class Axis {
 public:
  Axis(int corners, double square_mm, double border_mm)
      : half_pattern_mm_(0.5 * (corners + 1) * square_mm),
        half_plate_mm_(half_pattern_mm_ + border_mm),
        square_mm_(square_mm),
        first_corner_mm_(-0.5 * (corners - 1) * square_mm) {}

  double half_plate_mm() const { return half_plate_mm_; }
  double half_pattern_mm() const { return half_pattern_mm_; }

  // Share of the interval within +- half.
  static double inside(double at, double width, double half) {
    const double reach = std::abs(at) + 0.5 * width;
    if (reach <= half) return 1;
    return std::clamp((half - std::abs(at)) / width + 0.5, 0.0, 1.0);
  }

  // Mean of the wave that is +1 between corners 0 and 1, -1 between 1 and 2, and so on.
  double stripes(double at, double width) const {
    const double phase = (at - first_corner_mm_) / square_mm_, half = 0.5 * width / square_mm_;
    const double cell = std::floor(phase - half);
    if (phase + half <= cell + 1) return std::fmod(cell, 2) == 0 ? 1 : -1;
    return (integral(phase + half) - integral(phase - half)) / (2 * half);
  }

 private:
  // Integral of the square wave with period 2: a triangle wave between 0 and 1.
  static double integral(double phase) {
    const double turn = phase - 2 * std::floor(0.5 * phase);
    return turn < 1 ? turn : 2 - turn;
  }

  double half_pattern_mm_, half_plate_mm_, square_mm_, first_corner_mm_;
};

// Light from a point of the plate, as a fraction of the background's at (0) and of the plate's (1).
class Plate {
 public:
  Plate(const BoardScene& scene, const Camera& camera, const Rigid3& world_from_board)
      : scene_(scene),
        u_axis_(scene.board.cols, scene.board.square_mm, scene.border_mm),
        v_axis_(scene.board.rows, scene.board.square_mm, scene.border_mm) {
    const Rigid3 board_from_camera = (camera.camera_from_world * world_from_board).inverse();
    const Eigen::Vector3d eye = board_from_camera.translation_mm;
    face_ = eye.z() < 0;
    const double cosine = std::abs(eye.z()) / eye.norm();
    light_ = scene.full_scale_electrons * (scene.ambient_fraction + (1 - scene.ambient_fraction) * cosine);
    // Board plane from image plane: the ray eye + s * R * (x, y, 1) meets z = 0 where
    // s = -eye_z / (R * (x, y, 1))_z, so (u, v, w) is linear in (x, y, 1).
    const Eigen::Matrix3d& r = board_from_camera.rotation;
    plane_from_ray_.row(0) = eye.x() * r.row(2) - eye.z() * r.row(0);
    plane_from_ray_.row(1) = eye.y() * r.row(2) - eye.z() * r.row(1);
    plane_from_ray_.row(2) = r.row(2);
  }

  const Axis& u_axis() const { return u_axis_; }
  const Axis& v_axis() const { return v_axis_; }

  Eigen::Vector2d hit_mm(const Eigen::Vector2d& normalised) const {
    const Eigen::Vector3d h = plane_from_ray_ * Eigen::Vector3d(normalised.x(), normalised.y(), 1);
    return h.head<2>() / h.z();
  }

  // What a sample at (u, v), `width` wide on the board, covers.
  struct Cover {
    double plate = 0;    // share that hits the plate
    double pattern = 0;  // share of the axis-aligned footprint inside the squares
    double parity = 0;   // mean of +1 (dark) and -1 (white)
    double ink = 0;      // share that markers cover
    bool is_uniform() const {
      return plate == 0 ||
             (plate == 1 && (pattern == 0 || (pattern == 1 && std::abs(parity) == 1 && (ink == 0 || ink == 1))));
    }
  };
  Cover cover(const Eigen::Vector2d& at, const Eigen::Vector2d& width) const {
    Cover c;
    c.plate = u_axis_.inside(at.x(), width.x(), u_axis_.half_plate_mm()) *
              v_axis_.inside(at.y(), width.y(), v_axis_.half_plate_mm());
    if (c.plate <= 0) return c;
    c.pattern = u_axis_.inside(at.x(), width.x(), u_axis_.half_pattern_mm()) *
                v_axis_.inside(at.y(), width.y(), v_axis_.half_pattern_mm());
    if (c.pattern > 0) c.parity = u_axis_.stripes(at.x(), width.x()) * v_axis_.stripes(at.y(), width.y());
    if (c.pattern > 0 && c.parity < 1 && !scene_.markers.empty()) c.ink = marker_ink(at, width);
    return c;
  }

  // Share of an axis-aligned footprint that is covered by dark cells of markers.
  double marker_ink(const Eigen::Vector2d& at, const Eigen::Vector2d& width) const {
    const BoardSpec& board = scene_.board;
    const auto number = [&](double mm, int squares) {
      return static_cast<int>(std::floor(mm / board.square_mm + 0.5 * squares));
    };
    const int rows = board.rows + 1, cols = board.cols + 1;
    const int c0 = std::max(0, number(at.x() - 0.5 * width.x(), cols)),
              c1 = std::min(cols - 1, number(at.x() + 0.5 * width.x(), cols)),
              r0 = std::max(0, number(at.y() - 0.5 * width.y(), rows)),
              r1 = std::min(rows - 1, number(at.y() + 0.5 * width.y(), rows));
    double covered_mm2 = 0;
    for (int row = r0; row <= r1; ++row) {
      for (int col = c0; col <= c1; ++col) {
        if ((row + col) % 2 == 0) continue;  // dark square
        // White squares of the rows above, then those to the left.
        const int id = (row * cols) / 2 + col / 2;
        const Eigen::Vector2d centre((col - 0.5 * board.cols) * board.square_mm,
                                     (row - 0.5 * board.rows) * board.square_mm);
        covered_mm2 += ink_of(scene_.markers[static_cast<std::size_t>(id)], at - centre, width);
      }
    }
    return covered_mm2 / (width.x() * width.y());
  }

  double electrons(const Cover& cover, const Eigen::Vector2d& at, double background) const {
    if (cover.plate <= 0) return background;
    double albedo = scene_.back_albedo;
    if (face_) {
      const double dark = cover.pattern * 0.5 * (1 + cover.parity) + cover.ink;
      albedo = scene_.white_albedo + dark * (scene_.dark_albedo - scene_.white_albedo);
    }
    const double slope = 0.8 * at.x() / u_axis_.half_plate_mm() - 0.6 * at.y() / v_axis_.half_plate_mm();
    const double light = light_ * (1 + scene_.light_gradient * slope);
    return background + cover.plate * (albedo * light - background);
  }

 private:
  // Area of the footprint on dark cells of one marker; `at` from its middle.
  double ink_of(const MarkerPattern& marker, const Eigen::Vector2d& at, const Eigen::Vector2d& width) const {
    const double cell_mm = scene_.board.marker_mm / marker.cells, half = 0.5 * scene_.board.marker_mm;
    const auto overlap = [&](double middle, double span, int cell) {
      const double low = std::max(middle - 0.5 * span, cell * cell_mm - half),
                   high = std::min(middle + 0.5 * span, (cell + 1) * cell_mm - half);
      return std::max(0.0, high - low);
    };
    double area = 0;
    for (int row = 0; row < marker.cells; ++row) {
      const double tall = overlap(at.y(), width.y(), row);
      if (tall == 0) continue;
      for (int col = 0; col < marker.cells; ++col) {
        if (marker.dark[static_cast<std::size_t>(row * marker.cells + col)])
          area += tall * overlap(at.x(), width.x(), col);
      }
    }
    return area;
  }

  const BoardScene& scene_;
  Axis u_axis_, v_axis_;
  bool face_ = true;
  double light_ = 0;
  Eigen::Matrix3d plane_from_ray_;
};

// Board coordinates of the corners of one row of pixels. (x1 - x0 + 1)
void hit_row(const Camera& camera, const Plate& plate, const Region& region, double y,
             std::vector<Eigen::Vector2d>& hits) {
  hits.clear();
  for (int x = region.x0; x <= region.x1; ++x) {
    hits.push_back(plate.hit_mm(normalised_from_pixel(camera, {x - 0.5, y})));
  }
}

// Mean over one pixel's area; its four corners lie at a, b (top), c, d (bottom) of the board.
double pixel_electrons(const Plate& plate, const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                       const Eigen::Vector2d& c, const Eigen::Vector2d& d, double background) {
  const Eigen::Vector2d across = 0.5 * (b - a + d - c), down = 0.5 * (c - a + d - b);
  const Eigen::Vector2d centre = 0.25 * (a + b + c + d);
  const Eigen::Vector2d whole = (across.cwiseAbs() + down.cwiseAbs()).cwiseMax(1e-9);
  const Plate::Cover once = plate.cover(centre, whole);
  if (once.is_uniform()) return plate.electrons(once, centre, background);
  const Eigen::Vector2d width = whole / kSamples;
  double sum = 0;
  for (int j = 0; j < kSamples; ++j) {
    for (int i = 0; i < kSamples; ++i) {
      const double s = (i + 0.5) / kSamples - 0.5, t = (j + 0.5) / kSamples - 0.5;
      const Eigen::Vector2d at = centre + s * across + t * down;
      sum += plate.electrons(plate.cover(at, width), at, background);
    }
  }
  return sum / (kSamples * kSamples);
}

}  // namespace

Image render_board(const Camera& camera, const Rigid3& world_from_board, const BoardScene& scene) {
  const double background = scene.background_albedo * scene.full_scale_electrons;
  Image image(camera.image_width_px, camera.image_height_px, static_cast<float>(background));
  const Plate plate(scene, camera, world_from_board);
  const auto region = plate_region(camera, world_from_board, plate.u_axis().half_plate_mm(),
                                   plate.v_axis().half_plate_mm(), 4 * scene.defocus_sigma_px + 1);
  if (!region) return image;

  std::vector<Eigen::Vector2d> upper, lower;
  hit_row(camera, plate, *region, region->y0 - 0.5, upper);
  for (int y = region->y0; y < region->y1; ++y) {
    hit_row(camera, plate, *region, y + 0.5, lower);
    for (std::size_t i = 0; i + 1 < upper.size(); ++i) {
      image.at(region->x0 + static_cast<int>(i), y) = static_cast<float>(
          pixel_electrons(plate, upper[i], upper[i + 1], lower[i], lower[i + 1], background));
    }
    std::swap(upper, lower);
  }
  if (scene.defocus_sigma_px > 0) {
    cv::Mat whole(image.height_px, image.width_px, CV_32F, image.pixels.data());
    cv::Mat part = whole(cv::Rect(region->x0, region->y0, region->x1 - region->x0, region->y1 - region->y0));
    cv::GaussianBlur(part.clone(), part, {}, scene.defocus_sigma_px, scene.defocus_sigma_px,
                     cv::BORDER_REPLICATE);
  }
  return image;
}

}  // namespace flamefield
