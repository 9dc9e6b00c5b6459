#include "tests/services/chaos.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>

#include <csignal>
#include <fstream>
#include <random>
#include <set>
#include <utility>

#include "services/bus/client.h"
#include "services/dispatcher/set_sender.h"
#include "services/ledger/reader.h"
#include "services/store/volume_file.h"
#include "tests/services/small_lab.h"

extern char** environ;

namespace flamefield::testing_support {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

Process::Process(const std::string& program, const std::vector<std::string>& arguments,
                 const std::filesystem::path& log) {
  const std::string path = std::string(FLAMEFIELD_BIN) + "/" + program;
  std::vector<char*> argv = {const_cast<char*>(path.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 2, log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  EXPECT_EQ(posix_spawn(&pid_, path.c_str(), &actions, nullptr, argv.data(), environ), 0) << path;
  posix_spawn_file_actions_destroy(&actions);
}

Process::Process(Process&& other) noexcept : pid_(std::exchange(other.pid_, 0)) {}

Process& Process::operator=(Process&& other) noexcept {
  std::swap(pid_, other.pid_);
  return *this;
}

Process::~Process() {
  if (pid_ == 0) return;
  signal(SIGKILL);
  wait();
}

void Process::signal(int number) const {
  if (pid_ != 0) ::kill(pid_, number);
}

int Process::wait() {
  int status = 0;
  ::waitpid(std::exchange(pid_, 0), &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

namespace {

// The processes of one installation, and the capture that goes on while they die.
class Battlefield {
 public:
  explicit Battlefield(const ChaosOptions& options)
      : options_(options), keys_(KeyRing::open_or_create(scratch_.path() / "keys").value()), bus_(keys_) {
    endpoint_ = endpoint_to_keep(bus_);
    start_dispatcher();
    for (int i = 0; i < options.workers; ++i) workers_.push_back(start_worker());
    client_.emplace(Client::connect(bus_, "producer", unique_name("client"), endpoint_).value());
    Dealer dealer(bus_, "producer", unique_name("capture"));
    EXPECT_TRUE(dealer.connect(endpoint_));
    sender_.emplace(std::move(dealer), SetSender::Options{.max_unacked = 64, .resend_after = 300ms});
  }

  void prepare();
  void fight(unsigned seed);
  void take_stock();
  const std::filesystem::path& directory() const { return scratch_.path(); }

 private:
  void start_dispatcher() {
    dispatcher_.emplace("flamefield-dispatchd",
                        std::vector<std::string>{"--data", scratch_.path(), "--endpoint", endpoint_,
                                                 "--events", "ipc://" + (scratch_.path() / "events").string(),
                                                 "--lease-ms", "1000", "--back-off-ms", "20"},
                        scratch_.path() / "log");
  }
  Process start_worker() {
    return Process(
        "flamefield-worker",
        {"--data", scratch_.path(), "--endpoint", endpoint_, "--threads", "1", "--heartbeat-ms", "100"},
        scratch_.path() / "log");
  }
  // The dispatcher may be dead at the moment: asked until it answers.
  Message insist(const Message& question) {
    Result<Message> answer = Accepted{};
    EXPECT_TRUE(eventually(
        [&] {
          answer = client_->ask(question, 500ms);
          return answer.has_value();
        },
        30s))
        << answer.error().message;
    return answer ? *answer : Message();
  }

  ChaosOptions options_;
  Scratch scratch_;
  KeyRing keys_;
  Bus bus_;
  std::string endpoint_;
  SmallLab lab_;
  std::optional<Process> dispatcher_;
  std::vector<Process> workers_;
  std::optional<Client> client_;
  std::optional<SetSender> sender_;
};

void Battlefield::prepare() {
  insist(PutRig{lab_.rig});
  for (int i = 0; i < 3; ++i) insist(PutSet{lab_.set("dark", CaptureKind::Dark, i)});
  insist(LivePlan{true, lab_.processing(3000 / kSlowdown)});  // long enough to be killed in
}

void Battlefield::fight(unsigned seed) {
  std::mt19937 random(seed);
  auto next_kill = Clock::now() + 100ms;
  int kills = 0, offered = 0;
  while (offered < options_.sets || kills < options_.kills) {
    if (offered < options_.sets && sender_->offer(lab_.set("burst", CaptureKind::Burst, offered))) ++offered;
    sender_->pump(20ms);
    if (kills == options_.kills || Clock::now() < next_kill) continue;
    ++kills;
    next_kill = Clock::now() + std::chrono::milliseconds(50 + random() % 200);
    if (random() % 2 == 0) {
      dispatcher_.reset();
      start_dispatcher();
    } else {
      Process& victim = workers_[random() % workers_.size()];
      victim = start_worker();  // the old one is killed on the way out
    }
  }
  EXPECT_TRUE(sender_->drain(kSlowdown * 30s)) << sender_->last_refusal();
  PutCapture end{"burst", CaptureKind::Burst, 1, 2, options_.sets, {}};
  for (const Camera& camera : lab_.rig.cameras) end.cameras.push_back(camera.name);
  insist(end);
  EXPECT_TRUE(eventually(
      [&] {
        const auto status = std::get<Status>(insist(GetStatus{}));
        return status.queued + status.leased == 0;
      },
      60s));
}

void Battlefield::take_stock() {
  auto reader = LedgerReader::open(scratch_.path());
  ASSERT_TRUE(reader) << reader.error().message;
  const auto receipt = reader->receipt("burst");
  ASSERT_TRUE(receipt) << receipt.error().message;
  EXPECT_TRUE(receipt->balances());
  EXPECT_EQ(receipt->sets, options_.sets);
  EXPECT_EQ(receipt->volumes, options_.sets);
  for (const auto& failure : receipt->failures) ADD_FAILURE() << failure.run_id << ": " << failure.reason;
  const auto runs = reader->runs();
  ASSERT_TRUE(runs);
  std::set<std::int64_t> indices;
  for (const RunRow& row : *runs) {
    EXPECT_TRUE(indices.insert(row.run.inputs.at(0).index).second) << row.run.id << " was committed twice";
    const auto volume = read_volume(scratch_.path() / row.run.volume_path);
    EXPECT_TRUE(volume) << (volume ? "" : volume.error().message);
  }
  EXPECT_EQ(indices.size(), static_cast<std::size_t>(options_.sets));
}

}  // namespace

void expect_survival(const ChaosOptions& options) {
  const unsigned seed = std::random_device()();
  SCOPED_TRACE(concat("seed ", seed));
  Battlefield field(options);
  field.prepare();
  if (!::testing::Test::HasFailure()) field.fight(seed);
  if (!::testing::Test::HasFailure()) field.take_stock();
  if (::testing::Test::HasFailure()) {
    std::ifstream log(field.directory() / "log");
    std::cerr << log.rdbuf();
  }
}

}  // namespace flamefield::testing_support
