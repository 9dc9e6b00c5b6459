#pragma once

#include <SQLiteCpp/SQLiteCpp.h>
#include <SQLiteCpp/Savepoint.h>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

#include "proto/codec.h"
#include "proto/error.h"

// Known to this folder only: what the writer and the reader share about SQLite.
namespace flamefield {

inline Error error_of(const SQLite::Exception& problem, const std::string& file) {
  const int code = problem.getErrorCode();
  const bool damaged = code == 11 /* SQLITE_CORRUPT */ || code == 26 /* SQLITE_NOTADB */;
  if (damaged)
    return data_loss(concat("ledger ", file), problem.what(),
                     "restore it from a backup, or recover with sqlite3")
        .value();
  return unavailable(concat("ledger ", file), problem.what(), "check free disk space and permissions")
      .value();
}

// Runs `act`, which returns a Result; SQLite's exceptions become errors.
template <class Act>
auto guarded(SQLite::Database& database, Act act) -> decltype(act()) {
  try {
    return act();
  } catch (const SQLite::Exception& problem) {
    return tl::unexpected(error_of(problem, database.getFilename()));
  }
}

struct Blob {
  std::string bytes;
};

// Prepared statements, kept by their text.
class Statements {
 public:
  explicit Statements(SQLite::Database& database) : database_(database) {}

  // The statement, reset, with the values bound to ?1, ?2, ...
  template <class... Values>
  SQLite::Statement& operator()(const char* sql, const Values&... values) {
    auto& statement = statements_[sql];
    if (!statement) statement = std::make_unique<SQLite::Statement>(database_, sql);
    statement->reset();
    statement->clearBindings();
    [[maybe_unused]] int i = 0;
    (bind(*statement, ++i, values), ...);
    return *statement;
  }

  // Runs it to its end; the number of rows changed.
  template <class... Values>
  int run(const char* sql, const Values&... values) {
    SQLite::Statement& statement = (*this)(sql, values...);
    const int changed = statement.exec();
    statement.reset();
    return changed;
  }

 private:
  static void bind(SQLite::Statement& statement, int i, const Blob& blob) {
    statement.bind(i, blob.bytes.data(), static_cast<int>(blob.bytes.size()));
  }
  static void bind(SQLite::Statement& statement, int i, std::string_view text) {
    statement.bind(i, std::string(text));
  }
  template <class Value>
  requires std::is_arithmetic_v<Value>
  static void bind(SQLite::Statement& statement, int i, Value value) {
    if constexpr (std::is_floating_point_v<Value>)
      statement.bind(i, static_cast<double>(value));
    else
      statement.bind(i, static_cast<std::int64_t>(value));
  }
  template <class Value>
  static void bind(SQLite::Statement& statement, int i, const std::optional<Value>& value) {
    if (value)
      bind(statement, i, *value);
    else
      statement.bind(i);
  }

  SQLite::Database& database_;
  std::map<std::string, std::unique_ptr<SQLite::Statement>> statements_;
};

// A record column as the message it holds. DataLoss when it is damaged.
template <class T>
Result<T> record_of(const SQLite::Column& column) {
  const auto* bytes = static_cast<const std::byte*>(column.getBlob());
  auto envelope = decode(std::span(bytes, static_cast<std::size_t>(column.getBytes())));
  if (auto* value = envelope ? std::get_if<T>(&envelope->message) : nullptr) return std::move(*value);
  return data_loss("record in the ledger", envelope ? "it is of another kind" : envelope.error().message,
                   "restore the ledger from a backup");
}

}  // namespace flamefield
