#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "services/bus/bus.h"
#include "services/scheduler/scheduler.h"

namespace flamefield {

// A scheduler that reads its schedules from the ledger of `data_dir`, and submits and records through the
// dispatcher at `endpoint`. Reprocessing is checked with the solvers' own rules.
Scheduler make_scheduler(Bus& bus, const std::string& endpoint, const std::filesystem::path& data_dir);

}  // namespace flamefield
