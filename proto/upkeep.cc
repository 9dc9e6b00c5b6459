#include "proto/upkeep.h"

namespace flamefield {

std::string_view name_of(MissedRuns policy) {
  return policy == MissedRuns::Once ? "once" : "skip";
}

std::string_view name_of(OverlapRuns policy) {
  return policy == OverlapRuns::Skip ? "skip" : "queue";
}

std::optional<MissedRuns> missed_runs_from_name(std::string_view name) {
  if (name == "once") return MissedRuns::Once;
  if (name == "skip") return MissedRuns::Skip;
  return std::nullopt;
}

std::optional<OverlapRuns> overlap_runs_from_name(std::string_view name) {
  if (name == "skip") return OverlapRuns::Skip;
  if (name == "queue") return OverlapRuns::Queue;
  return std::nullopt;
}

}  // namespace flamefield
