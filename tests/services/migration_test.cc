#include <SQLiteCpp/Database.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "services/ledger/books.h"
#include "services/ledger/ledger.h"
#include "services/ledger/query.h"
#include "services/ledger/reader.h"
#include "services/ledger/schema.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

// A ledger of the first version, or as a later one that had taken it over left it.
class OldLedger {
 public:
  explicit OldLedger(int version) {
    const auto sql = std::filesystem::path(FLAMEFIELD_TEST_DATA) / "ledger-schema-1.sql";
    const std::string command =
        concat("sqlite3 ", ledger_path(scratch_.path()).string(), " < ", sql.string(), " && sqlite3 ",
               ledger_path(scratch_.path()).string(), " 'PRAGMA journal_mode=WAL' >/dev/null");
    EXPECT_EQ(std::system(command.c_str()), 0) << "is sqlite3 installed?";
    SQLite::Database database(ledger_path(scratch_.path()).string(), SQLite::OPEN_READWRITE);
    EXPECT_TRUE(migrate(database, version));
  }
  const std::filesystem::path& path() const { return scratch_.path(); }

 private:
  Scratch scratch_;
};

// `old` was opened for writing, and has to hold what was in the dump.
void expect_everything_kept(const OldLedger& old) {
  EXPECT_TRUE(Books::open(old.path())->integrity()->empty());
  auto reader = LedgerReader::open(old.path());
  ASSERT_TRUE(reader) << reader.error().message;
  EXPECT_EQ(reader->captures()->size(), 4u);
  const auto runs = reader->runs();
  ASSERT_TRUE(runs) << runs.error().message;
  ASSERT_EQ(runs->size(), 2u);
  const RunRow& single = runs->at(runs->at(0).run.inputs.size() == 1 ? 0 : 1);
  EXPECT_NEAR(single.run.residual, 0.0506080446902001, 1e-12);
  EXPECT_EQ(single.run.host, "") << "the old record did not have it";
  EXPECT_TRUE(reader->rig(single.run.processing.rig_id));
  EXPECT_EQ(reader->events()->size(), 4u);
  // Old volumes are artefacts now, without a checksum.
  const auto artefacts = Books::open(old.path())->artefacts();
  ASSERT_EQ(artefacts->size(), 2u);
  EXPECT_EQ(artefacts->at(0).sha256, "");
  EXPECT_EQ(
      LedgerQuery::open(old.path())->work(*parse_filter("solver = osem and not stale", 0), 10)->size(),
      2u);
}

TEST(Migration, AReaderOfAnOldLedgerAsksForMigration) {
  const OldLedger old(1);
  const auto reader = LedgerReader::open(old.path());
  ASSERT_FALSE(reader);
  EXPECT_EQ(reader.error().code, ErrorCode::InvalidInput);
  EXPECT_FALSE(LedgerQuery::open(old.path()));
  EXPECT_FALSE(Books::open(old.path()));
}

TEST(Migration, EveryEarlierSchemaKeepsEverythingOnTheWayToTheNewest) {
  for (int version = 1; version < newest_schema_version(); ++version) {
    SCOPED_TRACE(concat("from version ", version));
    const OldLedger old(version);
    {
      auto ledger = Ledger::open(old.path());
      ASSERT_TRUE(ledger) << ledger.error().message;
      EXPECT_EQ(ledger->status()->sets, 7);
    }
    expect_everything_kept(old);
  }
}

TEST(Migration, OpeningAgainChangesNothing) {
  const OldLedger old(1);
  { ASSERT_TRUE(Ledger::open(old.path())); }
  auto ledger = Ledger::open(old.path());
  ASSERT_TRUE(ledger) << ledger.error().message;
  EXPECT_EQ(ledger->status()->runs, 2);
}

}  // namespace
}  // namespace flamefield
