#include "proto/job.h"

#include <algorithm>
#include <cctype>

#include "proto/fingerprint.h"

namespace flamefield {

std::string_view name_of(Combine combine) {
  return combine == Combine::Mean ? "mean" : "each";
}

std::string_view name_of(Priority priority) {
  switch (priority) {
    case Priority::Scheduled:
      return "scheduled";
    case Priority::Interactive:
      return "interactive";
    case Priority::Live:
      return "live";
  }
  return "unknown";
}

std::string_view name_of(JobState state) {
  switch (state) {
    case JobState::Queued:
      return "queued";
    case JobState::Leased:
      return "leased";
    case JobState::Done:
      return "done";
    case JobState::Failed:
      return "failed";
  }
  return "unknown";
}

std::string_view name_of(JobAction action) {
  switch (action) {
    case JobAction::Pause:
      return "pause";
    case JobAction::Resume:
      return "resume";
    case JobAction::Cancel:
      return "cancel";
    case JobAction::Retry:
      return "retry";
  }
  return "unknown";
}

std::optional<JobState> job_state_from_name(std::string_view name) {
  for (const JobState state : {JobState::Queued, JobState::Leased, JobState::Done, JobState::Failed}) {
    if (name_of(state) == name) return state;
  }
  return std::nullopt;
}

std::optional<Priority> priority_from_name(std::string_view name) {
  for (const Priority priority : {Priority::Scheduled, Priority::Interactive, Priority::Live}) {
    if (name_of(priority) == name) return priority;
  }
  return std::nullopt;
}

std::string inputs_fingerprint(const Job& job) {
  Fingerprint print;
  for (const SetId& set : job.inputs) {
    print.add(set.capture);
    print.add(set.index);
  }
  print.add(job.processing.dark_capture);
  print.add(job.processing.background_capture);
  print.add(job.processing.flat_capture);
  return print.text();
}

std::string recipe_fingerprint(const Processing& processing) {
  Fingerprint print;
  print.add(fingerprint(processing.recipe));
  const Grid& grid = processing.grid;
  for (int n : {grid.nx, grid.ny, grid.nz}) print.add(n);
  for (Eigen::Index a = 0; a < 3; ++a) {
    print.add(grid.spacing_mm[a]);
    print.add(grid.origin_mm[a]);
  }
  return print.text();
}

std::string run_id_of(const Job& job) {
  Fingerprint print;
  print.add(inputs_fingerprint(job));
  print.add(recipe_fingerprint(job.processing));
  print.add(job.processing.rig_id);
  print.add(job.program_version);
  std::string which = "mean";
  if (job.inputs.size() == 1) {
    which = std::to_string(job.inputs[0].index);
    if (which.size() < 4) which.insert(0, 4 - which.size(), '0');
  }
  return concat(job.inputs.empty() ? "" : job.inputs[0].capture, '-', which, '-', print.text().substr(0, 8));
}

bool is_file_safe(std::string_view name) {
  const auto ok = [](unsigned char c) { return std::isalnum(c) || c == '.' || c == '_' || c == '-'; };
  return !name.empty() && name.size() <= 200 && name[0] != '.' && std::all_of(name.begin(), name.end(), ok);
}

std::string staged_path(std::string_view path, std::int64_t token) {
  const std::size_t slash = path.rfind('/'), dot = path.rfind('.');
  const bool has_extension = dot != path.npos && (slash == path.npos || dot > slash);
  const std::size_t at = has_extension ? dot : path.size();
  return concat(path.substr(0, at), ".part-", token, path.substr(at));
}

}  // namespace flamefield
