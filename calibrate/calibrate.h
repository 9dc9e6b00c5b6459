#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calibrate/bundle.h"
#include "calibrate/detect.h"
#include "calibrate/quality.h"
#include "proto/rig.h"

namespace flamefield {

struct CalibrationOptions {
  std::vector<std::string> cameras = {};  // that ought to be there; others in the images join them
  std::string reference_pose = {};        // the board on the burner; empty: the first pose that was seen
  Rigid3 world_from_reference = {};       // where that board is: the only thing that fixes the world frame
  IntrinsicsMode intrinsics = IntrinsicsMode::Prior;
  IntrinsicsPrior prior = {};
  std::optional<double> focal_px = {};  // nominal, of every camera
  std::vector<Camera> known = {};       // cameras of known intrinsics, found by name; required by Fixed
  bool free_aspect = false;             // fy / fx
  bool free_tangential = false;         // p1 p2
  bool free_k3 = false;
  bool free_bow = false;          // the board's sagitta along columns and rows
  double reject_sigmas = 4.5;     // corners further off than this many sigmas per axis are left out
  bool require_connected = true;  // false: calibrate the cameras that hang together, name the others
  bool split_half = true;         // calibrate twice more, from every other pose
  MeasuringVolume volume = {};    // where errors count
};

// One camera's view of one pose, and what became of it.
struct ViewReport {
  std::string camera;
  std::string pose;
  std::string reason;                         // why the view was not used; empty when it was
  std::vector<Eigen::Vector2d> corners_px;    // as in Detection
  std::vector<Eigen::Vector2d> residuals_px;  // estimated minus detected; empty unless used
  std::vector<bool> used;                     // one for each residual
  bool turned = false;                        // renumbered, as the board looks the same from its other end
  int rejected = 0;
  double rms_px = 0;  // per point, over the corners used

  bool is_used() const { return !residuals_px.empty(); }
};

// Board poses that two cameras both used.
struct SharedPoses {
  std::string a, b;
  int poses = 0;
};

// Two cameras of which one hangs together with the reference and the other does not: a board pose that both
// see would join their parts.
struct MissingLink {
  std::string connected, loose;
};

// Where corners were seen.
struct Coverage {
  std::vector<double>
      image;          // share of an 8 x 6 grid over each camera's image that holds corners (rig.cameras)
  double volume = 0;  // share of the measuring volume within a square of a corner, in steps of a square
};

// How two calibrations from disjoint halves of the poses (the reference is in both) differ.
struct SplitHalf {
  double rotation_rad = 0;    // RMS over the cameras
  double translation_mm = 0;  // RMS of the camera centres
  VolumeError volume;
};

struct CalibrationReport {
  Rig rig;                           // cameras in the order in which they first appear; quality filled in
  std::vector<std::string> cameras;  // all that were named in the input
  std::vector<std::string> poses;
  std::vector<std::optional<Rigid3>> world_from_board;  // one for each pose, where known
  std::string reference_pose;
  std::vector<ViewReport> views;   // in the order of the detections
  std::vector<SharedPoses> pairs;  // each pair with at least one, a before b in `cameras`
  bool connected = false;
  std::vector<std::string> unconnected;    // cameras that no chain of shared poses ties to the reference
  std::vector<MissingLink> missing_links;  // one for each loose part; neighbours by the order of the cameras
  int turned_views = 0;
  double rms_px = 0;    // per point, as OpenCV states it
  double sigma_px = 0;  // noise of one corner coordinate, from residuals and redundancy
  int corners = 0;      // used
  int rejected_corners = 0;
  Eigen::Vector2d bow_mm{0, 0};  // sagitta of the board along columns and rows, where it was estimated
  Eigen::Vector2d bow_sigma_mm{0, 0};
  VolumeError expected_volume_error;     // from the covariance; no images of the truth are needed
  double expected_volume_error_mm = 0;   // the mean in object space, at the cameras' mean distance
  std::vector<double> camera_volume_px;  // of which each camera has this share (rig.cameras)
  std::vector<double> volume_map_px;  // and each point of the volume this, RMS over the cameras (points_of)
  Coverage coverage;
  double clustering = 1;  // see uncertainty.h; contained in all expected errors and sigmas
  MeasuringVolume volume;
  std::optional<SplitHalf> split_half;  // none with fewer than 10 poses, or loose cameras in a half
  bool converged = false;
  int iterations = 0;
  std::string stop_reason;
  double seconds = 0;  // wall time
};

// The whole ring in one joint bundle adjustment. InvalidInput: no board seen at all, fewer than two poses,
// image sizes of a camera differ, the reference pose unknown or unseen, a camera twice in one pose, corner
// counts that do not fit the board, cameras that hang loose (unless allowed), intrinsics fixed but unknown.
Result<CalibrationReport> calibrate(std::span<const Detection> detections, const BoardSpec& board,
                                    const CalibrationOptions& options = {});

}  // namespace flamefield
