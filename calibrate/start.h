#pragma once

#include <optional>
#include <span>
#include <vector>

#include "calibrate/detect.h"
#include "proto/camera.h"

namespace flamefield {

// A board pose as one camera alone sees it.
struct SinglePose {
  Rigid3 camera_from_board;
  double rms_px = 0;
  double clarity = 1;  // >= 1: by what factor the mirrored pose of a planar target (IPPE) fits worse
};

// Pinhole of one camera from its own board views (Zhang 2000), principal point in the image centre, no
// distortion. None when the views do not determine a plausible focal length, e.g. all of them parallel.
std::optional<Camera> single_camera_start(std::span<const Detection* const> views, const BoardSpec& board);

// Pose of the board in front of a known camera (Collins and Bartoli, "Infinitesimal plane-based pose
// estimation", 2014), refined. None when no pose fits.
std::optional<SinglePose> single_pose(const Camera& camera, const Detection& view, const BoardSpec& board);

// One edge of the graph between cameras and board poses.
struct Edge {
  std::size_t camera = 0;
  std::size_t pose = 0;
  SinglePose seen;
};

// Poses in the world, none where no path of edges leads.
struct Chain {
  std::vector<std::optional<Rigid3>> camera_from_world;
  std::vector<std::optional<Rigid3>> world_from_board;
};

// Walks from the reference pose along the clearest edges first (a maximum spanning tree, Prim 1957).
Chain chain_poses(std::span<const Edge> edges, std::size_t cameras, std::size_t poses,
                  std::size_t reference_pose, const Rigid3& world_from_reference);

}  // namespace flamefield
