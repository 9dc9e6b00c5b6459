#include "services/serve/live_planner.h"

namespace flamefield {

Recipe live_recipe() {
  return {.solver = "hessian", .settings = {{"hessian.max_iterations", std::int64_t{24}}}};
}

Result<> LivePlanner::start() {
  const auto accepted = dispatcher_.ask_for<Accepted>(LivePlan{.on = true, .processing = processing_},
                                                      std::chrono::seconds(10));
  if (!accepted) return tl::unexpected(accepted.error());
  return {};
}

Result<> LivePlanner::use_rig(const std::string& rig_id) {
  processing_.rig_id = rig_id;
  return start();
}

Result<> LivePlanner::watch(const CaptureState& state) {
  if (is_capturing(state.phase) || state.id.empty() || state.id == known_ || state.sets == 0) return {};
  known_ = state.id;
  switch (state.kind) {
    case CaptureKind::Dark:
      processing_.dark_capture = state.id;
      return start();
    case CaptureKind::Background:
      processing_.background_capture = state.id;
      return start();
    case CaptureKind::Flat:
      processing_.flat_capture = state.id;
      return start();
    case CaptureKind::Board:
    case CaptureKind::Burst:
    case CaptureKind::Live:
      break;
  }
  return {};
}

}  // namespace flamefield
