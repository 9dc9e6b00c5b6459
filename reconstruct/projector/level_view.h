#pragma once

#include <Eigen/Core>
#include <vector>

#include "proto/camera.h"
#include "proto/volume.h"
#include "reconstruct/projector/column_kernels.h"

namespace flamefield {

// What a pixel averages over: its own area, and the blur circle of a lens of finite aperture.
struct PixelModel {
  bool area = true;        // false: one central ray
  double pixel_px = 1;     // side of the averaged square, in pixels of the image computed
  double aperture_mm = 0;  // diameter of the entrance pupil; 0: pinhole
  double focus_mm = 0;     // distance of the plane in focus along the optical axis
};

// A level camera's image columns are parallel to world y: x axis and optical axis horizontal, no distortion.
bool is_level(const Camera& camera, double tolerance_px = 0.01);

// Geometry of a level camera against the volume. All lines of sight of a pixel column lie in one vertical
// plane, so on every plane of voxels across the column's main direction (constant z, or constant x) they meet
// one vertical line, at voxel coordinate q on the other horizontal axis. Where and how large its pixels are
// there is linear in the plane's index k.
class LevelView {
 public:
  LevelView(const Camera& camera, const Grid& grid, const PixelModel& model);

  int cols() const { return static_cast<int>(along_z_.size()); }
  bool along_z(int col) const { return along_z_[static_cast<std::size_t>(col)] != 0; }
  struct Run {
    int begin = 0, end = 0;
  };
  // Runs of neighbouring pixel columns with one main direction.
  const std::vector<Run>& runs(bool along_z) const { return along_z ? runs_along_z_ : runs_along_x_; }

  // q, half, m and half_px of a StripPatch.
  struct Strips {
    float q[kPatch] = {}, half[kPatch] = {}, m[kPatch] = {}, half_px[kPatch] = {};
  };
  // Pixel columns col, ... on planes plane, ... of their main direction.
  StripPatch patch(int col, int cols, int plane, int planes, Strips& out) const;

  // Planes 0 and 1, 2 and 3, ... share one size of pixels, that between them, where this moves no line of
  // sight by more than kMostShift: half as many columns to resample. Only for pixels of finite size: what the
  // model of a central ray is for is comparison with others.
  int alike() const { return alike_; }
  static constexpr double kMostShift_voxels = 0.09;

  // Where a pixel column's line of sight meets a plane, voxels on the other horizontal axis.
  float crossing(int col, int plane) const {
    return q_.at(static_cast<std::size_t>(col), static_cast<float>(plane));
  }

  double height() const { return height_; }    // of the camera's centre above voxel row 0, voxels
  double axis_up() const { return axis_up_; }  // of the principal point above the bottom row, px

  // Pixel columns that may see voxel column (x, z), a few to spare.
  Run near(int x, int z) const;

  // Length of the line of sight of pixel `up` (from the bottom) between two planes, mm.
  float length_mm(int col, int up) const;

  // Smallest and largest height of a pixel in the box, and the largest half width it averages over, voxels.
  double smallest_m() const { return smallest_m_; }
  double largest_m() const { return largest_m_; }
  double largest_half() const { return largest_half_; }
  bool in_front() const { return nearest_m_ > 0; }  // every plane lies in front of the camera

 private:
  // Values at column `col` on plane 0, and their growth from plane to plane.
  struct Linear {
    std::vector<float> at0, step;
    float at(std::size_t col, float k) const { return at0[col] + k * step[col]; }
  };
  float half_px(float depth_mm) const;
  float middle(int plane, int planes) const;
  void note_extremes(std::size_t col, int planes, int others);

  PixelModel model_;
  Eigen::Vector3d origin_mm_, spacing_mm_, right_, forward_, centre_mm_;
  double axis_px_;
  float focal_px_;
  double focal_up_px_, axis_up_, height_;
  float bare_half_px_ = 0;  // without a lens
  int planes_along_z_, planes_along_x_, alike_ = 1;
  std::vector<std::uint8_t> along_z_;
  std::vector<Run> runs_along_z_, runs_along_x_;
  Linear q_, half_, m_, depth_mm_;  // half: of the bare pixel's width
  std::vector<double> step_mm_;     // from plane to plane along the optical axis
  std::vector<double> slant2_;      // squared length of the column's horizontal direction with unit depth
  double largest_m_ = 0, smallest_m_, nearest_m_, largest_half_ = 0;
};

}  // namespace flamefield
