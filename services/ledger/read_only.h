#pragma once

#include <filesystem>
#include <memory>

#include "services/ledger/database.h"

namespace flamefield {

// A ledger opened by whoever only asks; many may, while one dispatcher writes.
struct ReadOnlyLedger {
  explicit ReadOnlyLedger(const std::string& file)
      : database(file, SQLite::OPEN_READONLY, 5000), sql(database) {}
  SQLite::Database database;
  Statements sql;
};

// NotFound: there is none in the directory. InvalidInput: another version than this program's.
Result<std::unique_ptr<ReadOnlyLedger>> open_read_only(const std::filesystem::path& directory);

}  // namespace flamefield
