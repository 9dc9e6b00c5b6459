#include "services/ledger/run_list.h"

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Transaction.h>
#include <gtest/gtest.h>

#include <set>

#include "services/ledger/ledger.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

// A ledger of `runs` runs, entered behind the writer's back: only the columns of the table matter.
std::filesystem::path filled(const Scratch& scratch, int runs) {
  EXPECT_TRUE(Ledger::open(scratch.path()));
  SQLite::Database database(ledger_path(scratch.path()).string(), SQLite::OPEN_READWRITE);
  SQLite::Transaction transaction(database);
  database.exec("PRAGMA defer_foreign_keys = ON; PRAGMA ignore_check_constraints = ON");
  database.exec(
      "INSERT INTO rigs VALUES('rig', 0, 1, NULL, x''); INSERT INTO recipes VALUES('r', 'mlem', ''), ('s', "
      "'sirt', '')");
  database.exec("WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < " +
                std::to_string(runs - 1) +
                ") INSERT INTO jobs(id, run_id, inputs_hash, recipe_hash, rig_id, program_version, "
                "recipe_id, priority, state, "
                "created_time_ns, record) SELECT i + 1, 'run-' || i, i, 'h', 'rig', '1', 'r', 0, 'done', 0, "
                "x'' FROM n");
  database.exec(
      "WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < " + std::to_string(runs - 1) +
      ") INSERT INTO runs(id, job_id, inputs_hash, recipe_hash, rig_id, program_version, capture, first_idx, "
      "inputs, solver, worker, volume_path, volume_bytes, volume_fingerprint, iterations, residual, "
      "started_time_ns, finished_time_ns, committed_time_ns, queue_s, fetch_s, prepare_s, solve_s, write_s, "
      "record) SELECT 'run-' || i, i + 1, i, 'h', 'rig', '1', 'burst-' || (i / 1000), i "
      "% 1000, 1, "
      "CASE WHEN i % 2 THEN 'sirt' ELSE 'mlem' END, 'worker', 'v', 1000 + i, 'f', 50, (i * 7919 % "
      "1000) / 1000.0, "
      "i * 1000, i * 1000 + 500, i * 1000 + 600, 0, 0, 0, 0, 0, zeroblob(600) FROM n");
  transaction.commit();
  return scratch.path();
}

TEST(RunList, PagesThroughEveryRunOnceInOrder) {
  const Scratch scratch;
  auto list = RunList::open(filled(scratch, 1037));
  ASSERT_TRUE(list) << list.error().message;
  std::set<std::string> seen;
  double last = -1;
  for (std::int64_t offset = 0; offset < 1037; offset += 100) {
    const auto page = list->page({.order = RunOrder::Residual, .is_descending = false, .offset = offset});
    ASSERT_TRUE(page) << page.error().message;
    EXPECT_EQ(page->total, 1037);
    for (const RunLine& line : page->lines) {
      EXPECT_TRUE(seen.insert(line.id).second) << line.id;
      EXPECT_GE(line.residual, last);
      last = line.residual;
    }
  }
  EXPECT_EQ(seen.size(), 1037u);
}

TEST(RunList, ConditionsNarrowAndSearchIsNoPattern) {
  const Scratch scratch;
  auto list = RunList::open(filled(scratch, 2000));
  ASSERT_TRUE(list);
  EXPECT_EQ(list->page({.capture = "burst-1"})->total, 1000);
  EXPECT_EQ(list->page({.solver = "sirt"})->total, 1000);
  EXPECT_EQ(list->page({.search = "RUN-199"})->total, 11);  // 199 and 1990 to 1999
  EXPECT_EQ(list->page({.search = "%"})->total, 0);
  EXPECT_EQ(list->page({.search = "'; DROP TABLE runs; --"})->total, 0);
  EXPECT_EQ(list->page({.rig_id = "other"})->total, 0);
  EXPECT_EQ(list->page({.limit = 3})->lines.front().id, "run-1999") << "newest first";
  EXPECT_EQ(list->solvers().value(), (std::vector<std::string>{"mlem", "sirt"}));
  EXPECT_EQ(list->jobs(10, 19, 3)->done, 10);
  EXPECT_EQ(list->jobs(10, 19, 3)->lines.front().id, 19);
}

TEST(RunList, APageOfAHundredThousandTakesLittle) {
  const Scratch scratch;
  auto list = RunList::open(filled(scratch, 100'000));
  ASSERT_TRUE(list);
  for (const RunOrder order : {RunOrder::Finished, RunOrder::Capture, RunOrder::Residual}) {
    const auto start = std::chrono::steady_clock::now();
    const auto page = list->page({.order = order, .offset = 60'000});
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    ASSERT_TRUE(page);
    EXPECT_EQ(page->total, 100'000);
    EXPECT_EQ(page->lines.size(), 100u);
    EXPECT_LT(seconds, 2.0 * testing_support::kSlowdown) << static_cast<int>(order);
    RecordProperty("order_" + std::to_string(static_cast<int>(order)) + "_ms",
                   static_cast<int>(1e3 * seconds));
  }
}

}  // namespace
}  // namespace flamefield
