#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "proto/camera.h"

namespace flamefield {

enum class IntrinsicsMode {
  Fixed,  // as known
  Prior,  // pulled towards what is known, as strongly as it is known
  Free,   // from the images alone
};

// How well a lens is known before its images are looked at; one standard deviation each.
struct IntrinsicsPrior {
  double focal_relative = 0.02;   // data sheet against mounted lens; only where a focal length was stated
  double centre_relative = 0.05;  // principal point about the image centre, in image widths
  double radial = 0.5;            // k1 and k2
};

struct BundleOptions {
  IntrinsicsMode intrinsics = IntrinsicsMode::Prior;
  IntrinsicsPrior prior = {};
  bool free_aspect = false;      // fy / fx
  bool free_tangential = false;  // p1 p2
  bool free_k3 = false;
  bool free_bow = false;      // the board's sagitta, one shape for all poses
  bool hold_cameras = false;  // cameras as they are; all board poses free
  double robust_px = 0;       // Huber's threshold; 0: plain least squares
  double noise_px = 0.1;      // expected sigma of a corner coordinate, weighs the priors
  int max_iterations = 60;
};

// One camera's view of one board pose.
struct BundleView {
  std::size_t camera = 0;
  std::size_t pose = 0;
  std::vector<Eigen::Vector2d> corners_px;  // not numbers where not seen, and then
  std::vector<bool> used;                   // not used; one for each corner
};

// The unknowns, and what was seen: corner i of a view is point board_mm[i] of its board.
struct Bundle {
  std::vector<Camera> cameras;
  std::vector<Camera> known;              // where the priors pull, one for each camera
  std::vector<bool> focal_known;          // whether its focal length was stated
  std::vector<Rigid3> world_from_board;   // one for each pose
  std::size_t fixed_pose = 0;             // defines the world frame
  std::vector<Eigen::Vector3d> board_mm;  // flat
  Eigen::Vector2d bow_mm{0, 0};           // how far the middle lies behind the edges, along columns and rows
  std::vector<BundleView> views;
};

// How far a bow of 1 mm along columns and along rows moves each point along the board's normal; mean zero.
std::vector<Eigen::Vector2d> bow_shapes(std::span<const Eigen::Vector3d> board_mm);

struct BundleSummary {
  bool converged = false;
  int iterations = 0;
  std::string stop_reason;
};

// Joint least squares over intrinsics, camera poses and board poses (Triggs et al., "Bundle adjustment: a
// modern synthesis", 2000): Levenberg-Marquardt with the board poses eliminated by Schur complement.
BundleSummary solve_bundle(Bundle& bundle, const BundleOptions& options);

// Estimated minus measured, of every corner of a view; not numbers where it was not seen. (rows, cols)
std::vector<Eigen::Vector2d> residuals_px(const Bundle& bundle, const BundleView& view);

// Unknowns that the observations determine.
int free_parameters(const Bundle& bundle, const BundleOptions& options);

}  // namespace flamefield
