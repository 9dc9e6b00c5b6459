#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "proto/rig.h"
#include "proto/upkeep.h"

namespace CLI {
class App;
}

namespace flamefield {

// --where, --stale, --recipe, --rig, --solver, --set, --sweep: what is done again, and what changes.
struct ReprocessOptions {
  ReprocessOrder order;
  std::filesystem::path recipe, rig;
  std::string solver;

  // Reads the files. The rig, if one was named, has to be stored before the order is carried out.
  std::pair<ReprocessOrder, std::optional<Rig>> read() const;
};
void add_reprocess_options(CLI::App& command, ReprocessOptions& options);

// --cron, --zone, --missed, --overlap
struct ScheduleOptions {
  std::string zone = "UTC", missed = "once", overlap = "skip";
  // Checked; ends the command with exit code 2 otherwise.
  Schedule schedule(const std::string& name, const std::string& cron, const ReprocessOrder& order) const;
};
void add_schedule_options(CLI::App& command, ScheduleOptions& options);

}  // namespace flamefield
