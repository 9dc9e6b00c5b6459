#pragma once

#include <optional>

#include "proto/capture.h"
#include "proto/job.h"
#include "services/bus/client.h"

namespace flamefield {

// The default solver with 24 iterations: from the volume before, they cost half a hundredth of Pearson's
// correlation at most (test_reconstruct_slow --gtest_filter='VariationalSlow.FromTheVolumeBefore*'), and two
// cores follow 15 cameras at 5 Hz (tests/live). The frames are kept: `flamefield reprocess` does them again
// at leisure.
Recipe live_recipe();

// Keeps the dispatcher's live plan up to date: every set of a burst becomes a volume with the given rig,
// recipe and grid, and with the newest dark, background and flat captures.
class LivePlanner {
 public:
  // `processing` names the rig, which the dispatcher must have.
  LivePlanner(Client dispatcher, Processing processing)
      : dispatcher_(std::move(dispatcher)), processing_(std::move(processing)) {}

  // Tells the dispatcher the plan as it stands.
  Result<> start();

  // From now on with another rig, which the dispatcher must have.
  Result<> use_rig(const std::string& rig_id);

  // To be called with the array's state now and then; a reference capture that ended enters the plan.
  Result<> watch(const CaptureState& state);

 private:
  Client dispatcher_;
  Processing processing_;
  std::string known_;  // capture that watch() has already dealt with
};

}  // namespace flamefield
