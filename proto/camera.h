#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>

#include "proto/error.h"
#include "proto/rigid3.h"

namespace flamefield {

struct Ray {
  Eigen::Vector3d origin_mm;
  Eigen::Vector3d direction;  // unit length
};

// A pinhole with OpenCV's lens model. Camera frame: x right, y down, z forward; the centre of the top-left
// pixel is (0, 0). Lengths in mm, image quantities in px.
struct Camera {
  std::string name;
  int image_width_px = 0;
  int image_height_px = 0;
  double fx_px = 0, fy_px = 0;            // focal lengths
  double cx_px = 0, cy_px = 0;            // principal point
  std::array<double, 5> distortion = {};  // k1 k2 p1 p2 k3
  Rigid3 camera_from_world;

  Eigen::Vector3d centre_mm() const { return camera_from_world.inverse().translation_mm; }
  bool is_distorted() const;
};

// Checks ranges (sizes and focal lengths positive, everything finite, a proper rotation).
Result<> validate(const Camera& camera);

// Normalised image coordinates (x/z, y/z) -> distorted pixel, and back (fixed point, to 1e-10).
Eigen::Vector2d pixel_from_normalised(const Camera& camera, const Eigen::Vector2d& normalised);
Eigen::Vector2d normalised_from_pixel(const Camera& camera, const Eigen::Vector2d& pixel);

// Pixel of a world point; none when the point is not in front of the camera.
std::optional<Eigen::Vector2d> project(const Camera& camera, const Eigen::Vector3d& world_mm);

// The line of sight of a pixel (fractional pixels allowed), in world coordinates.
Ray pixel_ray(const Camera& camera, const Eigen::Vector2d& pixel);

// The same camera seen through a region of interest whose top-left pixel is (x0, y0), its pixels then
// merged `binning` by `binning`. The pixel centre convention is kept.
Camera cropped_and_binned(const Camera& camera, int x0_px, int y0_px, int width_px, int height_px,
                          int binning);

}  // namespace flamefield
