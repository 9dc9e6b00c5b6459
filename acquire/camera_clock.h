#pragma once

#include <cmath>
#include <cstdint>
#include <deque>

namespace flamefield {

// Puts one camera's times on the time that the array has in common, by the least-squares line through the
// offsets of the latest pulses that it shares with the others. Drift is held near zero as far as the pulses
// say little about it (ridge regression; Hoerl and Kennard, Technometrics 12, 1970): a burst of a tenth of a
// second must not be carried on over a pause of a minute.
class CameraClock {
 public:
  // Forgets all: the camera has started again.
  void reset() { *this = CameraClock(); }

  std::int64_t common_of(std::int64_t camera_ns) const;

  // The camera says `camera_ns` of a pulse that was at `common_ns`. Times rise.
  void learn(std::int64_t camera_ns, std::int64_t common_ns);

  // Enough pulses are known, and fit a line well enough, to contradict a trigger counter by less than
  // `tolerance_ns`. Arming a busy machine sets clocks badly, and incomplete sets teach them wrongly.
  bool is_settled(std::int64_t tolerance_ns) const {
    return points_.size() >= 8 && 12 * spread_ns() <= static_cast<double>(tolerance_ns);
  }
  double drift_ppm() const { return 1e6 * drift_; }
  // Root mean square of how far recent pulses were from where they were expected.
  double spread_ns() const { return std::sqrt(mean_square_ns2_); }

 private:
  struct Point {
    std::int64_t camera_ns = 0, offset_ns = 0;  // common minus camera time
  };
  void fit();

  std::deque<Point> points_;
  std::int64_t centre_ns_ = 0;  // of the camera
  double offset_ns_ = 0;        // there
  double drift_ = 0;            // of the offset, ns per ns
  double mean_square_ns2_ = 0;
};

}  // namespace flamefield
