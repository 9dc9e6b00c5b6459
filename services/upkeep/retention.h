#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "services/ledger/query.h"

namespace flamefield {

// What may go, and what has to stay with the reason.
struct RetentionPlan {
  struct Kept {
    std::string run_id, why;
  };
  std::vector<std::string> run_ids;
  std::int64_t bytes = 0;
  std::vector<Kept> kept;  // selected, but not to be made again
};

// Only files that can be made again are ever proposed: of runs that are done, whose every set reads back from
// the spool whole, whose reference captures, rig and recipe are there, and that carry no tag "keep".
// NotFound: no ledger.
Result<RetentionPlan> plan_retention(const std::filesystem::path& directory, const Filter& filter);

}  // namespace flamefield
