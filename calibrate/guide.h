#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "calibrate/calibrate.h"
#include "calibrate/detect.h"

namespace flamefield {

struct GuideOptions {
  std::vector<std::string> cameras;  // that are to be calibrated, in the order in which they stand
  int wanted_poses = 20;
  int wanted_boards = 6;         // for each camera
  double wanted_volume = 0.6;    // share of the measuring volume through which the board went
  double wanted_error_px = 0.1;  // of each camera in the measuring volume
};

// Where in a picture corners are wanted: nine fields over it.
struct ImageRegion {
  double left_px = 0, top_px = 0, width_px = 0, height_px = 0;
};

struct CameraGuide {
  std::string camera;
  int boards = 0;                 // poses in which it saw the board
  ImageRegion region;             // empty while no picture has come
  std::array<bool, 9> covered{};  // (rows, cols) of the region
  double coverage = 0;            // share of the nine
};

// What a session still lacks, in words for whoever holds the board.
struct Guidance {
  std::vector<CameraGuide> cameras;
  std::vector<MissingLink> links_missing;
  std::vector<std::string> needed;  // most urgent first; empty: nothing
};

// `taken` holds what each camera saw of each pose so far. With a solution the measuring volume decides where
// corners count and which cameras are uncertain; before, the middle half of each picture does.
Guidance guide(std::span<const Detection> taken, const GuideOptions& options,
               const CalibrationReport* solution = nullptr);

// How far the corners that both hold lie apart, RMS; none when they share too few.
std::optional<double> displacement_px(const Detection& a, const Detection& b);

// Whether some camera sees the board elsewhere than in every pose that was taken: by more than `limit_px`,
// or at all. (one detection a camera in `seen`)
bool is_new_pose(std::span<const Detection> seen, std::span<const Detection> taken, double limit_px);

}  // namespace flamefield
