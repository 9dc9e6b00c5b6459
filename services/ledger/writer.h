#pragma once

#include "services/ledger/database.h"
#include "services/ledger/ledger.h"
#include "services/ledger/lock.h"

// Known to this folder only: what the files of the writer share.
namespace flamefield {

struct Ledger::Impl {
  Impl(FileLock held, const std::filesystem::path& path)
      : lock(std::move(held)),
        database(path.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE, 5000),
        sql(database) {}

  // Found by a statement that selects one integer.
  template <class... Values>
  std::optional<std::int64_t> integer(const char* text, const Values&... values) {
    SQLite::Statement& statement = sql(text, values...);
    std::optional<std::int64_t> found;
    if (statement.executeStep() && !statement.getColumn(0).isNull())
      found = statement.getColumn(0).getInt64();
    statement.reset();
    return found;
  }

  // upkeep.cc
  void add_artefacts(const Run& run);
  // Identical work is there: it is done again, under its old number, when its files were retired.
  std::optional<std::int64_t> revive(const Job& job);

  FileLock lock;
  SQLite::Database database;
  Statements sql;
};

}  // namespace flamefield
