#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <thread>

#include "services/store/volume_file.h"
#include "tests/cli/program.h"

// The program with real ranks on this machine, over shared memory only.
namespace flamefield {
namespace {

const std::string kMpirun =
    "mpirun --allow-run-as-root --oversubscribe --bind-to none --mca btl self,vader --mca plm isolated "
    "--mca oob_tcp_if_include lo --mca mpi_yield_when_idle 1 ";

class MpiProgram : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scratch_ = new Scratch;
    setup_ =
        shell(scratch_->path(),
              "\"$F\" phantom torus --size 24,22,67 --spacing-mm 1 --out truth.vtkhdf && "
              "\"$F\" ring --views 8 --spacing-deg 22.5 --radius-mm 400 --volume truth.vtkhdf --image 40,40 "
              "--out rig.yaml && "
              "\"$F\" render --volume truth.vtkhdf --rig rig.yaml --out projections.nxs");
  }
  static void TearDownTestSuite() {
    delete scratch_;
    scratch_ = nullptr;
  }
  void SetUp() override { ASSERT_EQ(setup_.exit_code, 0) << setup_.err; }

  static std::string command(int ranks, const std::string& arguments) {
    return concat("OMPI_MCA_rmaps_base_oversubscribe=1 timeout 120 ", kMpirun, "-n ", ranks, " \"$F\"-mpi ",
                  arguments);
  }
  static ProgramResult run(int ranks, const std::string& arguments) {
    return shell(scratch_->path(), command(ranks, arguments));
  }
  static std::filesystem::path at(const std::string& name) { return *scratch_ / name; }
  static Volume volume(const std::string& name) { return *read_volume(at(name)); }

  static inline Scratch* scratch_ = nullptr;
  static inline ProgramResult setup_;
};

const std::string kReconstruct =
    "reconstruct --projections projections.nxs --rig rig.yaml --size 24,22,67 --spacing-mm 1 --threads 1 ";

TEST_F(MpiProgram, GivesTheSameBitsWith1And2And3Ranks) {
  for (const std::string solver : {"hessian", "tv", "sirt", "mlem", "cgls"}) {
    const std::string arguments =
        kReconstruct + "--solver " + solver + " --set " + solver + ".max_iterations=12 ";
    for (const int ranks : {1, 2, 3}) {
      const ProgramResult result = run(ranks, concat(arguments, "--json --out ", solver, ranks, ".vtkhdf"));
      ASSERT_EQ(result.exit_code, 0) << result.err;
      EXPECT_EQ(json_number(result.out, "iterations"), 12) << "one JSON document, of the first rank";
    }
    const Volume one = volume(solver + "1.vtkhdf");
    EXPECT_EQ(volume(solver + "2.vtkhdf").values, one.values) << solver;
    EXPECT_EQ(volume(solver + "3.vtkhdf").values, one.values) << solver << ": 67 planes, 3 ranks";
    EXPECT_EQ(*read_text_file(at(solver + "1.vtkhdf")), *read_text_file(at(solver + "3.vtkhdf")));
  }
}

TEST_F(MpiProgram, RecordsHowItEnded) {
  ASSERT_EQ(run(2, kReconstruct + "--solver sirt --set sirt.max_iterations=3 --out done.vtkhdf").exit_code,
            0);
  const std::string record = *read_text_file(at("done.vtkhdf.run.json"));
  EXPECT_TRUE(contains(record, "\"state\": \"done\"")) << record;
  EXPECT_TRUE(contains(record, "\"rank\": 1")) << record;
  EXPECT_EQ(json_number(record, "iterations"), 3);
}

TEST_F(MpiProgram, RefusesWhatRanksCannotDo) {
  const ProgramResult map = run(2, kReconstruct + "--solver map --out no.vtkhdf");
  EXPECT_NE(map.exit_code, 0);
  EXPECT_TRUE(contains(map.err, "solver map on 2 ranks (it works in one process only)")) << map.err;
  const ProgramResult many = run(5, kReconstruct + "--solver sirt --out no.vtkhdf");
  EXPECT_TRUE(contains(many.err, "5 ranks for 67 planes")) << many.err;
  EXPECT_TRUE(contains(many.err, "at most 4 ranks")) << many.err;
  const ProgramResult missing = run(2, kReconstruct + "--rig none.yaml --out no.vtkhdf");
  EXPECT_NE(missing.exit_code, 0);
  const ProgramResult unknown = run(2, "phantom torus");
  EXPECT_TRUE(contains(unknown.err, "unknown command 'phantom'")) << unknown.err;
  EXPECT_FALSE(std::filesystem::exists(at("no.vtkhdf")));
}

TEST_F(MpiProgram, RefusesRanksWithOtherFiles) {
  // Each rank reads the rig that is named after it.
  const ProgramResult copied =
      shell(scratch_->path(),
            "cp rig.yaml rig0.yaml && sed 's/-3\\.9/-3.8/;s/focal/focal/' rig.yaml > rig1.yaml && "
            "\"$F\" ring --views 8 --spacing-deg 22.4 --radius-mm 400 --volume truth.vtkhdf --image "
            "40,40 --out rig1.yaml");
  ASSERT_EQ(copied.exit_code, 0) << copied.err;
  const std::string wrapped =
      "sh -c '\"$0\"-mpi reconstruct --projections projections.nxs --rig rig$OMPI_COMM_WORLD_RANK.yaml "
      "--size "
      "24,22,67 --spacing-mm 1 --solver sirt --out other.vtkhdf' \"$F\"";
  const ProgramResult result = shell(scratch_->path(), "timeout 60 " + kMpirun + "-n 2 " + wrapped);
  EXPECT_NE(result.exit_code, 0);
  EXPECT_TRUE(contains(result.err, "rank 1 on ") && contains(result.err, "another rig")) << result.err;
}

// The first number behind "pid" of a rank, once the record is there.
int pid_of_rank(const std::filesystem::path& record, int rank) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (std::chrono::steady_clock::now() < deadline) {
    const auto text = read_text_file(record);
    const auto at = text ? text->find(concat("\"rank\": ", rank, ",")) : std::string::npos;
    if (at != std::string::npos) return std::atoi(text->c_str() + text->find("\"pid\": ", at) + 7);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return 0;
}

// Runs until somebody ends it; meanwhile(record).
ProgramResult run_and(const std::string& line, const std::filesystem::path& folder,
                      const std::function<void()>& meanwhile) {
  std::jthread other(meanwhile);
  return shell(folder, line);
}

TEST_F(MpiProgram, EndsWithAClearRecordWhenARankIsKilled) {
  const std::string endless = kReconstruct + "--solver sirt --set sirt.max_iterations=1000000 ";
  for (const int victim : {0, 1}) {
    const std::string out = concat("killed", victim, ".vtkhdf");
    const ProgramResult result = run_and(command(2, endless + "--out " + out), scratch_->path(), [&] {
      const int pid = pid_of_rank(at(out + ".run.json"), victim);
      ASSERT_GT(pid, 1);
      ::kill(pid, SIGKILL);
    });
    EXPECT_NE(result.exit_code, 0);
    const std::string record = *read_text_file(at(out + ".run.json"));
    EXPECT_TRUE(contains(record, "\"state\": \"failed\"")) << record;
    EXPECT_TRUE(contains(record, concat("rank ", victim, " (pid "))) << record;
    EXPECT_TRUE(contains(result.err, concat("rank ", victim, " (pid "))) << result.err;
    EXPECT_FALSE(std::filesystem::exists(at(out)));
  }
}

TEST_F(MpiProgram, KeepsTheBestSoFarWhenTheFirstRankIsAskedToStop) {
  const std::string endless =
      kReconstruct + "--solver sirt --set sirt.max_iterations=1000000 --out stopped.vtkhdf";
  const ProgramResult result = run_and(command(2, endless), scratch_->path(), [&] {
    ::kill(pid_of_rank(at("stopped.vtkhdf.run.json"), 0), SIGTERM);
  });
  EXPECT_NE(result.exit_code, 0);
  EXPECT_TRUE(contains(result.err, "stopped by request")) << result.err;
  EXPECT_TRUE(contains(*read_text_file(at("stopped.vtkhdf.run.json")), "\"state\": \"cancelled\""));
  EXPECT_EQ(volume("stopped.vtkhdf").grid.nz, 67);
}

TEST_F(MpiProgram, EvolvesOnIslands) {
  const ProgramResult result = run(
      2, kReconstruct + "--solver ert --set ert.max_generations=400 --seed 3 --json --out islands.vtkhdf");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_GE(json_number(result.out, "iterations"), 400);
  EXPECT_LT(json_number(result.out, "residual"), 0.5);
}

}  // namespace
}  // namespace flamefield
