#pragma once

namespace SQLite {
class Database;
}

namespace flamefield {

// Brings a ledger to the newest schema, one transaction per version. Throws SQLite::Exception. False when
// the file was written by a newer program.
bool migrate(SQLite::Database& database);
// Only up to a version, as an earlier program would have; for tests.
bool migrate(SQLite::Database& database, int version);

// What PRAGMA user_version says after migrate().
int newest_schema_version();

}  // namespace flamefield
