// Pilots on a real Slurm: munge, a controller and two nodes on this host.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "services/bus/client.h"
#include "services/ledger/reader.h"
#include "services/process/run_program.h"
#include "services/store/file.h"
#include "tests/cli/program.h"
#include "tests/services/chaos.h"
#include "tests/services/small_lab.h"
#include "tests/services/support.h"
#include "tests/slurm/slurm_cluster.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;
using namespace testing_support;
using Json = nlohmann::json;
using Clock = std::chrono::steady_clock;

// A dispatcher with its data directory, a lab.toml, and the command line.
class Lab {
 public:
  explicit Lab(const std::string& cluster_settings)
      : keys_(KeyRing::open_or_create(scratch_ / "data/keys").value()), bus_(keys_) {
    endpoint_ = endpoint_to_keep(bus_);
    configure(cluster_settings);
    start_dispatcher();
    client_.emplace(Client::connect(bus_, "operator", unique_name("operator"), endpoint_).value());
    capture_.emplace(Client::connect(bus_, "capture", unique_name("capture"), endpoint_).value());
  }
  ~Lab() {
    if (::testing::Test::HasFailure()) std::cerr << log();
  }

  void configure(const std::string& cluster_settings) {
    overwrite(scratch_ / "lab.toml", concat("data_directory = \"data\"\n[bus]\ndispatcher = \"", endpoint_,
                                            "\"\n[cluster]\n", cluster_settings));
  }
  void start_dispatcher() {
    dispatcher_.reset();
    dispatcher_.emplace(
        "flamefield-dispatchd",
        std::vector<std::string>{"--data", data(), "--endpoint", endpoint_, "--back-off-ms", "100"},
        scratch_ / "dispatchd.log");
  }
  std::string data() const { return (scratch_ / "data").string(); }
  std::string log() const { return read_text_file(scratch_ / "dispatchd.log").value_or(""); }
  ProgramResult run(const std::string& arguments) const { return flamefield(scratch_.path(), arguments); }
  Json cluster(const std::string& arguments) const {
    const ProgramResult result = run("cluster " + arguments + " --config lab.toml --json");
    EXPECT_EQ(result.exit_code, 0) << arguments << ": " << result.err;
    return Json::parse(result.out.empty() ? "{}" : result.out, nullptr, false);
  }
  // Asked until it answers: it may be dead at the moment.
  Message insist(const Message& question) {
    const bool of_capture =
        std::holds_alternative<PutSet>(question) || std::holds_alternative<PutCapture>(question);
    for (const auto give_up = Clock::now() + 60s; Clock::now() < give_up;) {
      auto answer = (of_capture ? *capture_ : *client_).ask(question, 1s);
      if (answer) return std::move(*answer);
      if (answer.error().code != ErrorCode::Unavailable) ADD_FAILURE() << answer.error().message;
    }
    ADD_FAILURE() << "no answer from the dispatcher within a minute";
    return Accepted{};
  }
  Status status() {
    Message answer = insist(GetStatus{});
    const auto* status = std::get_if<Status>(&answer);
    return status ? *status : Status{};
  }
  bool until(const std::function<bool(const Status&)>& holds, std::chrono::seconds limit) {
    return eventually([&] { return holds(status()); }, limit);
  }
  // A capture of the small flame, with `sets` pulses.
  void put_capture(int sets) {
    insist(PutRig{small_.rig});
    for (int i = 0; i < 2; ++i) insist(PutSet{small_.set("dark", CaptureKind::Dark, i)});
    for (int i = 0; i < sets; ++i) insist(PutSet{small_.set("burst", CaptureKind::Burst, i)});
    PutCapture end{"burst", CaptureKind::Burst, 1, 2, sets, {}};
    for (const Camera& camera : small_.rig.cameras) end.cameras.push_back(camera.name);
    insist(end);
  }
  void submit_set(std::int64_t index, int iterations) {
    Submit order;
    order.sets = {{"burst", index}};
    order.processing = small_.processing(iterations);
    insist(order);
  }
  std::string pilot_logs() const {
    std::string all;
    std::error_code problem;
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(scratch_ / "data/pilots", problem)) {
      if (entry.path().extension() == ".log")
        all += concat("== ", entry.path().string(), '\n', read_text_file(entry.path()).value_or(""));
    }
    return all;
  }
  const Scratch& scratch() const { return scratch_; }

 private:
  Scratch scratch_;
  KeyRing keys_;
  Bus bus_;
  SmallLab small_;
  std::string endpoint_;
  std::optional<Process> dispatcher_;
  std::optional<Client> client_, capture_;
};

constexpr char kStandIn[] = "set -- " FLAMEFIELD_SLURM_WORKER " \\\"${@:2}\\\"";

class Slurm : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (!SlurmCluster::missing().empty()) return;
    cluster_ = std::make_unique<SlurmCluster>();
    if (cluster_->is_up()) start_wall_time_cut();
  }
  static void TearDownTestSuite() {
    cut_.reset();
    cluster_.reset();
  }
  void SetUp() override {
    if (const std::string missing = SlurmCluster::missing(); !missing.empty()) GTEST_SKIP() << missing;
    ASSERT_FALSE(cut_name_.empty()) << cluster_->logs();
  }

  // Slurm counts limits in minutes: begun here, looked at by the last test.
  static void start_wall_time_cut() {
    cut_ =
        std::make_unique<Lab>(concat("partition = \"flame\"\nmemory_mib = 256\nidle_s = 200\ndrain_s = 10\n"
                                     "cores = 1\nsetup = \"",
                                     kStandIn, "\"\n"));
    cut_->put_capture(1);
    overwrite(cut_->scratch() / "data/hang", "");
    cut_->submit_set(0, 1);
    cut_name_ = cut_->cluster("up --pilots 1 --minutes 1")["name"];
    cut_started_ = Clock::now();
  }

  static inline std::unique_ptr<SlurmCluster> cluster_;
  static inline std::unique_ptr<Lab> cut_;
  static inline std::string cut_name_;
  static inline Clock::time_point cut_started_;
};

TEST_F(Slurm, TwoHundredSetsAreDoneOnceThoughEverythingIsKilledOnce) {
  constexpr int kSets = 200;
  Lab lab("partition = \"flame\"\nmemory_mib = 512\ncores = 1\nidle_s = 5\n");
  lab.put_capture(kSets);
  lab.submit_set(0, 3);  // like which the others are done
  {
    Process first("flamefield-worker", {"--data", lab.data()}, lab.scratch() / "worker.log");
    ASSERT_TRUE(lab.until([](const Status& s) { return s.done == 1; }, 30s));
  }
  const ProgramResult asked = lab.run(
      "reprocess --where \"capture = 'burst'\" --set mlem.max_iterations=600 --executor slurm --pilots 4 "
      "--config lab.toml --json");
  ASSERT_EQ(asked.exit_code, 0) << asked.err;
  EXPECT_EQ(Json::parse(asked.out)["jobs"], kSets);
  const std::string name = Json::parse(asked.out)["pilots"];

  const auto at = [&](std::int64_t done, const char* what, const std::function<void()>& strike) {
    ASSERT_TRUE(lab.until([&](const Status& s) { return s.done > done; }, 120s)) << what << lab.pilot_logs();
    strike();
  };
  at(20, "kill a pilot", [&] { EXPECT_GE(kill_processes({"flamefield-worker", name + "-2"}), 1); });
  at(60, "kill a slurmd", [&] { cluster_->kill("w1"); });
  at(80, "start it again", [&] { cluster_->start("w1"); });
  at(100, "kill the dispatcher", [&] { lab.start_dispatcher(); });
  at(140, "kill slurmctld", [&] { cluster_->kill("slurmctld"); });
  at(160, "start it again", [&] { cluster_->start("slurmctld"); });
  ASSERT_TRUE(
      lab.until([](const Status& s) { return s.done == kSets + 1 && s.queued + s.leased == 0; }, 120s))
      << lab.pilot_logs();

  auto reader = LedgerReader::open(lab.data()).value();
  const auto runs = reader.runs({.limit = 10 * kSets}).value();
  std::map<std::int64_t, int> volumes;
  for (const RunRow& row : runs) {
    if (row.run.worker.starts_with(name)) ++volumes[row.run.inputs.at(0).index];
    EXPECT_TRUE(std::filesystem::exists(lab.scratch() / "data" / row.run.volume_path));
  }
  for (int i = 0; i < kSets; ++i) EXPECT_EQ(volumes[i], 1) << "set " << i;
  std::map<std::string, int> commits;
  const auto diary = reader.events(1'000'000).value();
  for (const Event& event : diary) commits[event.subject] += event.kind == "run-committed";
  for (const auto& [run, count] : commits) EXPECT_LE(count, 1) << run;
  const auto receipt = reader.receipt("burst");
  ASSERT_TRUE(receipt);
  EXPECT_TRUE(receipt->balances());
  EXPECT_EQ(receipt->failed, 0);

  // Pilots without work go home, and then their key goes.
  EXPECT_TRUE(eventually(
      [&] {
        const Json campaigns = lab.cluster("status")["campaigns"];
        return campaigns.empty() || !campaigns[0]["alive"].get<bool>();
      },
      40s))
      << lab.pilot_logs();
  lab.cluster("down");
  EXPECT_FALSE(contains(lab.run("keys list --data data").out, name));
  EXPECT_TRUE(lab.cluster("status")["campaigns"].empty());
  EXPECT_FALSE(contains(lab.log() + lab.pilot_logs(),
                        read_text_file(lab.scratch() / "data/keys/worker.key")->substr(0, 40)));
}

TEST_F(Slurm, WithoutSbatchThePilotsAreRefusedAndNothingIsLeft) {
  Lab lab("partition = \"flame\"\n");
  const ProgramResult result =
      shell(lab.scratch().path(), "PATH=/nowhere \"$F\" cluster up --pilots 1 --config lab.toml");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_TRUE(contains(result.err, "sinfo") || contains(result.err, "sbatch")) << result.err;
  EXPECT_TRUE(contains(result.err, "slurm-client")) << result.err;
  EXPECT_TRUE(!std::filesystem::exists(lab.scratch() / "data/pilots") ||
              std::filesystem::is_empty(lab.scratch() / "data/pilots"));
}

TEST_F(Slurm, ARefusedAccountIsToldInSlurmsWordsAndLeavesNothing) {
  Lab lab("partition = \"members\"\naccount = \"strangers\"\n");
  const ProgramResult result = lab.run("cluster up --pilots 1 --config lab.toml");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_TRUE(contains(result.err, "account")) << result.err;
  EXPECT_FALSE(contains(lab.run("keys list --data data").out, "flamefield-"));
  EXPECT_TRUE(std::filesystem::is_empty(lab.scratch() / "data/pilots"));
  lab.configure("partition = \"nowhere\"\n");
  const ProgramResult unknown = lab.run("cluster up --pilots 1 --config lab.toml");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_TRUE(contains(unknown.err, "flame, ") || contains(unknown.err, ", flame")) << unknown.err;
}

TEST_F(Slurm, APartitionThatIsDownLetsPilotsWaitAndStatusSaysWhy) {
  Lab lab("partition = \"closed\"\n");
  lab.put_capture(1);
  lab.submit_set(0, 1);
  const ProgramResult result = lab.run("cluster up --pilots 1 --config lab.toml");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(contains(result.err, "down")) << result.err;
  Json status;
  EXPECT_TRUE(eventually([&] {
    status = lab.cluster("status");
    return status["campaigns"][0]["pilots"].size() == 1 &&
           status["campaigns"][0]["pilots"][0]["reason"] == "PartitionDown";
  })) << status.dump(2);
  const std::string why = status["waiting"][0]["why"];
  EXPECT_TRUE(contains(why, "no worker connected") && contains(why, "the partition is down")) << why;
  EXPECT_EQ(lab.cluster("down")["dismissed"].size(), 1u);
}

TEST_F(Slurm, ASubmissionWaitsForAControllerThatIsAwayAndIsMadeOnce) {
  Lab lab("partition = \"flame\"\nmemory_mib = 256\ncores = 1\nidle_s = 30\n");
  cluster_->kill("slurmctld");
  std::jthread back([] {
    std::this_thread::sleep_for(2s);
    cluster_->start("slurmctld");
  });
  const std::string name = lab.cluster("up --pilots 2")["name"];
  back.join();
  EXPECT_TRUE(lab.until([](const Status& s) { return s.workers.size() == 2; }, 40s)) << lab.pilot_logs();
  const auto listed = run_program({"squeue", "--noheader", "--name=" + name, "--format=%i"}, 20s);
  ASSERT_TRUE(listed);
  EXPECT_EQ(std::ranges::count(listed->out, '\n'), 2) << listed->out;
  lab.cluster("down");
  EXPECT_TRUE(lab.until([](const Status& s) { return s.workers.empty(); }, 40s));
}

// One node runs another version, the other one writes elsewhere: each is turned away by name, with the
// reason.
TEST_F(Slurm, NodesWithAnotherVersionOrAnotherDirectoryAreRefusedByName) {
  Lab lab("");
  std::filesystem::create_directories(lab.scratch() / "elsewhere/volumes");
  for (const std::string node : {"w1", "w2"}) {
    lab.configure(concat(
        "partition = \"flame\"\nmemory_mib = 5000\ncores = 1\nidle_s = 30\nsbatch = [\"--nodelist=", node,
        "\"]\nsetup = '''\nset -- " FLAMEFIELD_SLURM_WORKER
        " \"${@:2}\"\n"
        "if [ \"$SLURMD_NODENAME\" = w1 ]; then export FLAMEFIELD_TEST_VERSION=0.0.9\n"
        "else words=(); for word in \"$@\"; do [ \"$word\" = ",
        lab.data(), " ] && word=", (lab.scratch() / "elsewhere").string(),
        "; words+=(\"$word\"); done; set -- \"${words[@]}\"; fi\n'''\n"));
    lab.cluster("up --pilots 1");
  }
  Json refused;
  EXPECT_TRUE(eventually([&] { return (refused = lab.cluster("status")["refused"]).size() == 2; }, 30s))
      << refused.dump(2) << lab.pilot_logs();
  const std::string all = refused.dump();
  EXPECT_TRUE(contains(all, "0.0.9")) << all;
  EXPECT_TRUE(contains(all, "finds no volumes")) << all;
  const auto are_gone = [&] {
    const Json campaigns = lab.cluster("status")["campaigns"];
    return std::ranges::none_of(campaigns, [](const Json& c) { return c["alive"].get<bool>(); });
  };
  EXPECT_TRUE(eventually(are_gone, 30s)) << "who was refused goes home";
  lab.cluster("down");
}

TEST_F(Slurm, PilotsWithARevokedOrExpiredKeyEnd) {
  Lab lab("partition = \"flame\"\nmemory_mib = 256\ncores = 1\nidle_s = 60\nsilence_s = 3\n");
  const std::string name = lab.cluster("up --pilots 1")["name"];
  ASSERT_TRUE(lab.until([](const Status& s) { return s.workers.size() == 1; }, 30s)) << lab.pilot_logs();
  ASSERT_EQ(lab.run("keys revoke worker " + name + " --data data").exit_code, 0);
  const auto is_over = [&] { return !lab.cluster("status")["campaigns"][0]["alive"].get<bool>(); };
  EXPECT_TRUE(eventually(is_over, 30s));
  EXPECT_TRUE(contains(lab.pilot_logs(), "its key was taken off the allow-list")) << lab.pilot_logs();
  lab.cluster("down");
  // One that is out of date does not even get in.
  lab.configure("partition = \"closed\"\nsilence_s = 3\nmemory_mib = 256\ncores = 1\n");
  const std::string late = lab.cluster("up --pilots 1")["name"];
  const auto key = lab.scratch() / "data/keys" / concat("worker-", late, ".pub");
  overwrite(key, read_text_file(key)->substr(0, 41) + "expires 1700000000\n");
  ASSERT_TRUE(run_program({"scontrol", "update", "JobName=" + late, "Partition=flame"}, 20s));
  EXPECT_TRUE(eventually(is_over, 30s)) << lab.pilot_logs();
  EXPECT_TRUE(contains(lab.pilot_logs(), "heard nothing of the dispatcher for 3 s")) << lab.pilot_logs();
  lab.cluster("down");
}

// What the supervisor of systemd does elsewhere: Slurm's own requeue takes two minutes.
TEST_F(Slurm, ALivePilotIsStartedAgainWithinItsJobAndTakesLiveWorkAlone) {
  Lab lab("live_partition = \"live\"\nmemory_mib = 256\ncores = 1\n");
  lab.put_capture(1);
  lab.submit_set(0, 1);
  const std::string name = lab.cluster("up --live --pilots 1")["name"];
  ASSERT_TRUE(lab.until([](const Status& s) { return s.workers.size() == 1; }, 30s)) << lab.pilot_logs();
  EXPECT_GE(kill_processes({"flamefield-worker", name + "-1"}), 1);
  EXPECT_TRUE(lab.until(
      [](const Status& s) {
        return std::ranges::any_of(s.workers, [](const auto& w) { return w.name.ends_with("-1.1"); });
      },
      20s))
      << lab.pilot_logs();
  const Status status = lab.status();
  EXPECT_EQ(status.done, 0);
  ASSERT_EQ(status.waiting.size(), 1u);
  EXPECT_EQ(status.waiting[0].why, "no worker connected but those for live work");
  lab.cluster("down");
}

TEST_F(Slurm, AJobCutByTheTimeLimitIsDoneElsewhereAtOnce) {
  ASSERT_FALSE(cut_name_.empty());
  ASSERT_TRUE(eventually([&] { return std::filesystem::exists(cut_->scratch() / "data/started"); }, 30s))
      << cut_->pilot_logs();
  std::filesystem::remove(cut_->scratch() / "data/hang");
  const std::string second = cut_->cluster("up --pilots 1 --minutes 10")["name"];
  ASSERT_TRUE(cut_->until([](const Status& s) { return s.workers.size() == 2; }, 30s)) << cut_->pilot_logs();
  EXPECT_EQ(cut_->status().leased, 1) << "the first one still has it";
  // Slurm looks at limits twice a minute.
  ASSERT_TRUE(cut_->until(
      [&](const Status& s) {
        return s.done == 1 || std::ranges::none_of(s.workers, [&](const auto& worker) {
                 return worker.name.starts_with(cut_name_) && worker.job_id != 0;
               });
      },
      120s))
      << cut_->pilot_logs();
  const auto cut = Clock::now();
  ASSERT_TRUE(cut_->until([](const Status& s) { return s.done == 1; }, 30s)) << cut_->pilot_logs();
  EXPECT_LT(Clock::now() - cut, 30s);
  auto reader = LedgerReader::open(cut_->data()).value();
  EXPECT_TRUE(reader.runs().value().at(0).run.worker.starts_with(second));
  RecordProperty("seconds_until_cut", static_cast<int>((cut - cut_started_) / 1s));
  cut_->cluster("down");
}

}  // namespace
}  // namespace flamefield
