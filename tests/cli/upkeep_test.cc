// The commands around the ledger, against an old ledger that a dispatcher has just migrated.
#include <gtest/gtest.h>

#include "tests/cli/program.h"

namespace flamefield {
namespace {

// A data folder "data" with the runs of tests/data, and a dispatcher that serves it while `line` runs.
ProgramResult with_dispatcher(const Scratch& scratch, const std::string& line) {
  return shell(
      scratch.path(),
      std::string(
          "mkdir -p data && { [ -e data/ledger.sqlite ] || sqlite3 data/ledger.sqlite < " FLAMEFIELD_TEST_DATA
          "/ledger-schema-1.sql; } && { " FLAMEFIELD_BIN
          "/flamefield-dispatchd --data data 2> log & pid=$!; }; "
          "for i in $(seq 500); do [ -S data/run/dispatcher.sock ] && break; sleep 0.02; "
          "done; ") +
          "( " + line + " ); code=$?; kill $pid; wait $pid; exit $code");
}

TEST(Upkeep, EveryCommandExplainsItself) {
  const Scratch scratch;
  for (const char* command :
       {"reprocess", "schedule add", "schedule list", "schedule remove", "schedule run-now", "rigs list",
        "rigs accept", "keys make", "keys list", "keys allow", "keys revoke", "ledger check", "ledger backup",
        "ledger retain", "runs compare", "runs tag", "runs list", "runs export"}) {
    const ProgramResult result = flamefield(scratch.path(), std::string(command) + " --help");
    EXPECT_EQ(result.exit_code, 0) << command;
    EXPECT_TRUE(contains(result.out, "Example")) << command << ": " << result.out;
  }
  EXPECT_TRUE(contains(flamefield(scratch.path(), "runs fields").out, "residual"));
}

TEST(Upkeep, KeysAreMadeAllowedListedAndRevokedWithoutAService) {
  const Scratch scratch;
  const ProgramResult made =
      shell(scratch.path(),
            "\"$F\" keys make && \"$F\" keys make worker --out node7 && stat -c %a node7/worker.key && "
            "\"$F\" keys allow worker node7/worker.pub --name node7 && \"$F\" keys list");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_TRUE(contains(made.out, "600\n"));
  EXPECT_TRUE(contains(made.out, "node7")) << made.out;
  const std::string secret = read_text_file(scratch / "node7" / "worker.key")->substr(0, 40);
  EXPECT_FALSE(contains(made.out + made.err, secret));
  EXPECT_EQ(flamefield(scratch.path(), "keys revoke worker node7").exit_code, 0);
  EXPECT_EQ(flamefield(scratch.path(), "keys revoke worker node7").exit_code, 2);
  EXPECT_EQ(flamefield(scratch.path(), "keys make king --out x").exit_code, 2);
  EXPECT_FALSE(contains(flamefield(scratch.path(), "keys list").out, "node7"));
}

TEST(Upkeep, RunsAreSelectedComparedTaggedAndPlanned) {
  const Scratch scratch;
  const ProgramResult result = with_dispatcher(
      scratch,
      "set -e; \"$F\" runs list --data data --where 'solver = osem and residual < 0.04' --json > "
      "list.json; "
      "R=$(\"$F\" runs list --data data --json | sed -n 's/^    \"id\": \"\\(.*\\)\",/\\1/p'); "
      "\"$F\" runs compare $R --data data > compare.txt; "
      "\"$F\" runs tag $(echo $R | cut -d' ' -f1) --add good --data data; "
      "\"$F\" runs list --data data --where 'tag = good' > tagged.txt; "
      "\"$F\" reprocess --data data --where 'solver = osem' --solver mlem --dry-run --json > plan.json; "
      "\"$F\" reprocess --data data --where 'solver = osem' --solver mlem --every '30 2 * * *' --zone "
      "Asia/Tokyo "
      "--name nightly; \"$F\" schedule list --data data > schedules.txt; \"$F\" schedule run-now nightly "
      "--data data; "
      "\"$F\" schedule remove nightly --data data; \"$F\" ledger backup copy.sqlite --data data; "
      "\"$F\" runs list --data data --where 'state = queued' > queued.txt");
  ASSERT_EQ(result.exit_code, 0) << result.err << *read_text_file(scratch / "log");
  const auto text = [&](const char* file) { return *read_text_file(scratch / file); };
  EXPECT_TRUE(contains(text("list.json"), "-mean-"));
  EXPECT_FALSE(contains(text("list.json"), "-0000-"));
  EXPECT_TRUE(contains(text("compare.txt"), "residual"));
  EXPECT_TRUE(contains(text("tagged.txt"), "20261122T"));
  EXPECT_EQ(json_number(text("plan.json"), "volumes"), 2);
  EXPECT_TRUE(contains(text("schedules.txt"), "nightly"));
  EXPECT_TRUE(contains(text("schedules.txt"), "T17:30:00")) << "02:30 in Tokyo: " << text("schedules.txt");
  EXPECT_TRUE(contains(result.out, "2 jobs are in line")) << result.out;
  EXPECT_TRUE(contains(text("queued.txt"), "queued"));
  EXPECT_GT(std::filesystem::file_size(scratch / "copy.sqlite"), 10'000u);
}

TEST(Upkeep, FaultsOfTheUserAreExitCodeTwoAndSayWhere) {
  const Scratch scratch;
  ASSERT_EQ(with_dispatcher(scratch, "true").exit_code, 0) << *read_text_file(scratch / "log");
  const std::vector<std::pair<std::string, std::string>> mistakes = {
      {"reprocess --data data --where 'solvr = mlem' --dry-run", "character 1: 'solvr'"},
      {"runs list --data data --where 'residual > 0.1 and'", "the end"},
      {"reprocess --data data --executor slurm", "no address of the dispatcher"},
      {"reprocess --data data --solver hesian --dry-run", "hessian"},
      {"reprocess --data data --sweep map.beta --dry-run", "TABLE.KEY=A,B,C"},
      {"reprocess --data data --every '61 * * * *'", "minute '61'"},
      {"reprocess --data data --every '@daily' --zone Mars/Olympus", "Mars/Olympus"},
      {"ledger retain --data data", "--where"},
      {"runs compare --data data --where 'residual > 5'", "two are needed"}};
  for (const auto& [arguments, part] : mistakes) {
    const ProgramResult result = flamefield(scratch.path(), arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments << ": " << result.err;
    EXPECT_TRUE(contains(result.err, part)) << arguments << ": " << result.err;
  }
  // Old volumes are not there in this folder: the books say so.
  const ProgramResult check = flamefield(scratch.path(), "ledger check --data data --json");
  EXPECT_EQ(check.exit_code, 1);
  EXPECT_TRUE(contains(check.out, "artefact-missing"));
}

}  // namespace
}  // namespace flamefield
