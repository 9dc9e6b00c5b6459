#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calibrate/calibrate.h"
#include "calibrate/compare.h"
#include "calibrate/guide.h"
#include "proto/calibration.h"
#include "proto/frame.h"

namespace flamefield {

// The calibration that a new one is compared with.
struct PreviousCalibration {
  std::int64_t version = 0;
  Rig rig;
};

struct CalibrationSessionOptions {
  std::vector<std::string> cameras;  // in the order in which they stand
  BoardSpec board;
  CalibrationOptions solving = {};  // its cameras and reference pose are the session's to fill in
  int wanted_poses = 20;
  double still_px = 0.3;  // a board that moves by less between two pictures is held still
  double new_px = 4;      // a pose that differs by less, in every camera, from one that was taken is no news
  int threads = 0;        // of detection; 0: all cores
  std::optional<PreviousCalibration> previous = {};
};

// A guided calibration session: looks at pictures, knows which poses are worth taking and what is missing,
// solves, compares. Where pictures come from and where they are kept is the caller's. One thread.
class CalibrationSession {
 public:
  explicit CalibrationSession(CalibrationSessionOptions options);

  // Finds the board in the newest pictures, or follows it where it is held still.
  Result<> look(const FrameSet& set);
  // Whether the board is held still in a new place, for at least two cameras to see (for one, where it is the
  // reference on the burner).
  bool is_worth_taking() const;
  // Whether it is held still, but to no avail: someone who only waits for a picture should go on.
  bool is_useless() const { return is_still_ && !is_worth_taking(); }

  // Takes what look() last saw, still or not. Returns its name; InvalidInput: no camera sees the board.
  Result<std::string> take();

  // With what was taken so far, of the cameras that hang together; quietly nothing where that is not enough.
  void solve_roughly();
  // Everything, to be accepted. InvalidInput as of calibrate(), e.g. naming cameras that hang loose.
  Result<> solve();

  int poses() const { return poses_; }
  const std::optional<CalibrationReport>& report() const { return report_; }  // of solve()
  const std::optional<RigComparison>& comparison() const { return comparison_; }
  const CalibrationSessionOptions& options() const { return options_; }

  // All but phase, id, message and error.
  void describe(CalibrationState& state) const;

 private:
  bool follow(std::span<const BoardView> views);

  const CalibrationSessionOptions options_;
  std::vector<Detection> seen_;   // in the newest pictures
  std::vector<Detection> taken_;  // of all poses
  int poses_ = 0;
  bool is_still_ = false, is_new_ = false;
  std::optional<CalibrationReport> rough_, report_;
  std::optional<RigComparison> comparison_;
};

}  // namespace flamefield
