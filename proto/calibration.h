#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/board.h"
#include "proto/rig.h"

// A guided calibration session: what is asked of it, what it says of itself, and what is kept of its result.
namespace flamefield {

struct StartCalibration {  // -> CalibrationState
  // What differs from the laboratory's configuration.
  std::optional<BoardSpec> board;
  std::optional<Eigen::Vector3d> reference_centre_mm;  // where the middle of the board on the burner is,
  std::optional<double> reference_azimuth_rad;         // and where its face looks
  std::int64_t wanted_poses = 20;
  bool automatic = false;  // takes a pose as soon as the board is still and new; else only when asked
};
struct TakePose {};  // -> CalibrationState; takes the next picture, still or not, if a camera sees the board
struct SolveCalibration {};  // -> CalibrationState, solving
struct AcceptCalibration {   // -> CalibrationStored; ends the session
  std::string accepted_by;
  std::string note;
};
struct DiscardCalibration {};  // -> CalibrationState, idle; the pictures that were taken stay in the ledger
struct GetCalibration {};      // -> CalibrationState

enum class CalibrationPhase { Idle, Detecting, Solving, Solved };
std::string_view name_of(CalibrationPhase phase);

struct CalibrationState {
  struct CameraState {
    std::string name;
    bool sees_board = false;         // in the newest picture
    std::string last_reason;         // why it does not
    std::vector<double> corners_px;  // of the newest picture: x, y, x, y, ...
    std::int64_t boards = 0;         // poses taken in which it saw the board
    double coverage = 0;             // share of nine fields over the part of its picture that counts,
    std::vector<bool> covered;       // and which of them hold corners (3 rows, 3 columns)
    std::vector<double> region_px;   // that part: left, top, width, height
    double expected_px = -1;  // error in the measuring volume as the solution foresees it; -1: none yet
    double shift_px = -1;     // against the calibration before; -1: unknown
    bool moved = false;
  };
  struct Link {
    std::string a, b;
  };
  CalibrationPhase phase = CalibrationPhase::Idle;
  std::string id;  // of the session and of the capture with its pictures; empty: none yet
  bool automatic = false;
  std::int64_t wanted_poses = 0, poses = 0;  // taken
  bool still = false, is_new = false;        // the board in the newest picture
  std::string message;                       // what happened last
  std::string error;                         // why the last request or solution failed
  std::vector<CameraState> cameras;
  std::vector<std::string> needed;  // what to do next, most urgent first; empty: nothing is missing
  std::vector<Link> links_missing;  // cameras that have to see one pose together
  double volume_coverage = 0;       // share of the measuring volume through which the board went
  // Of the solution, once there is one:
  std::string verdict;  // green, amber, red; empty: not yet
  double rms_px = 0, volume_mean_px = 0, volume_worst_px = 0;
  std::string worst_camera;
  std::int64_t previous_version = 0;  // of the calibration that shifts refer to; 0: none
  std::vector<std::string> moved;     // cameras
  std::int64_t accepted_version = 0;  // 0: not accepted
  std::string report;                 // below the data folder; empty: none yet
  std::string board;                  // what is looked for, in words; empty: no session yet
};

// A calibration that someone accepted. Versions count from 1.
struct Calibration {
  std::int64_t version = 0;      // given by the ledger
  std::int64_t predecessor = 0;  // 0: the first one
  std::string rig_id;
  std::int64_t accepted_time_ns = 0;
  std::string accepted_by, note;
  std::string capture;  // with its pictures; may be empty
  std::int64_t poses = 0;
  double rms_px = 0, volume_mean_px = 0, volume_worst_px = 0;
  std::string worst_camera;
  std::string verdict;
  std::vector<std::string> moved;  // cameras that stand elsewhere than in the predecessor
  double worst_shift_px = -1;  // of a camera against the predecessor, in the measuring volume; -1: unknown
  std::string most_shifted;    // which one
};
struct PutCalibration {  // -> CalibrationStored; version, predecessor, rig_id and time are the ledger's to
                         // fill
  Calibration calibration;
  Rig rig;
};
struct CalibrationStored {
  std::int64_t version = 0;
  std::string rig_id;
};

}  // namespace flamefield
