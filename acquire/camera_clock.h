#pragma once

#include <cmath>
#include <cstdint>

namespace flamefield {

// Puts one camera's times on the time that the array has in common, by a line fitted to the pulses that the
// camera shares with the others: offset and drift, old pulses forgotten. The gains are those of the
// growing-memory least-squares fit of a line (Brookner, Tracking and Kalman Filtering Made Easy, 1998,
// section 1.2.10), held once the memory is long enough.
class CameraClock {
 public:
  // Forgets all: the camera has started again.
  void reset() { *this = CameraClock(); }

  std::int64_t common_of(std::int64_t camera_ns) const;

  // The camera says `camera_ns` of a pulse that was at `common_ns`. Times rise.
  void learn(std::int64_t camera_ns, std::int64_t common_ns);

  // Enough pulses are known to contradict a trigger counter.
  bool is_settled() const { return matches_ >= 3; }
  double drift_ppm() const { return 1e6 * drift_; }
  // Root mean square of how far recent pulses were from where they were expected.
  double spread_ns() const { return std::sqrt(mean_square_ns2_); }

 private:
  std::int64_t matches_ = 0;
  std::int64_t last_ns_ = 0;  // of the camera
  double offset_ns_ = 0;      // common minus camera time, at last_ns_
  double drift_ = 0;          // of the offset, ns per ns
  double mean_square_ns2_ = 0;
};

}  // namespace flamefield
