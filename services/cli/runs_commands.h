#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "services/cli/app.h"
#include "services/ledger/query.h"

// What the files of the command `runs` share.
namespace flamefield {

// --where, with --capture, --solver and --rig as short forms, and --limit.
struct RunSelection {
  std::string where, capture, solver, rig;
  std::int64_t limit = 1000;

  // Newest first. Ends the command when the filter has a fault.
  std::vector<WorkRow> read(const std::filesystem::path& data_dir) const;
};
void add_selection(CLI::App& command, RunSelection& selection);

void add_compare(CLI::App& runs, Session& session);
void add_tag(CLI::App& runs, Session& session);  // and fields

}  // namespace flamefield
