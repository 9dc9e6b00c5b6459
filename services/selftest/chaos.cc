#include "services/selftest/chaos.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <deque>
#include <map>
#include <optional>
#include <random>
#include <thread>

#include "services/bus/client.h"
#include "services/dispatcher/set_sender.h"
#include "services/ledger/reader.h"
#include "services/selftest/child_process.h"
#include "services/selftest/miniature.h"
#include "services/selftest/severable_link.h"
#include "services/store/volume_file.h"

namespace flamefield {

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kLease = 1s;

enum class Blow { KillDispatcher, KillWorker, Cut, Freeze };

std::vector<Blow> blows(const ChaosOptions& o, std::mt19937& random) {
  std::vector<Blow> out;
  out.insert(out.end(), static_cast<std::size_t>(o.dispatcher_kills), Blow::KillDispatcher);
  out.insert(out.end(), static_cast<std::size_t>(o.worker_kills), Blow::KillWorker);
  out.insert(out.end(), static_cast<std::size_t>(o.cuts), Blow::Cut);
  out.insert(out.end(), static_cast<std::size_t>(o.freezes), Blow::Freeze);
  std::shuffle(out.begin(), out.end(), random);
  return out;
}

// Below the ports that Linux hands to outgoing connections: one of those may take such a port while its owner
// is away, even a client that keeps knocking. 0: none.
int free_port(Bus& bus) {
  std::random_device random;
  for (int tries = 0; tries < 100; ++tries) {
    const int port = 20'000 + static_cast<int>(random() % 12'000);
    Router probe(bus);
    if (probe.bind(concat("tcp://127.0.0.1:", port))) return port;
  }
  return 0;
}

// The processes of one installation, and the capture that goes on while they die.
class Battlefield {
 public:
  Battlefield(const ChaosOptions& options, std::stop_token stop)
      : o_(options), stop_(std::move(stop)), random_(options.seed) {}

  Result<> prepare();
  Result<> fight(const std::function<void(int)>& progress);
  Result<> wait_until_done();
  Result<> take_stock();
  ChaosResult result;

 private:
  Result<> start_dispatcher();
  Result<ChildProcess> start_worker();
  Result<> strike(Blow blow);
  Result<> thaw(bool all);
  Result<Message> insist(const Message& question);
  Result<> go_on() const {
    if (stop_.stop_requested()) return unavailable("the self-test", "stopped", "start it again");
    return {};
  }

  ChaosOptions o_;
  std::stop_token stop_;
  std::mt19937 random_;
  Miniature lab_;
  int port_ = 0;
  std::unique_ptr<Bus> bus_;
  std::unique_ptr<SeverableLink> link_;
  std::string endpoint_;  // through the link
  std::optional<ChildProcess> dispatcher_;
  std::vector<ChildProcess> workers_;
  std::optional<std::pair<int, Clock::time_point>> frozen_;  // pid, until when
  std::optional<Client> client_, producer_;  // with an operator's key, and with that of capture
  std::optional<SetSender> sender_;
};

Result<> Battlefield::start_dispatcher() {
  dispatcher_.reset();  // the old one is killed first: the ledger takes one writer
  auto started =
      ChildProcess::start(o_.programs / "flamefield-dispatchd",
                          {"--data", o_.directory, "--endpoint", concat("tcp://127.0.0.1:", port_),
                           "--events", "ipc://" + (o_.directory / "events").string(), "--lease-ms",
                           std::to_string(std::chrono::milliseconds(kLease).count()), "--back-off-ms", "20"},
                          o_.directory / "log");
  if (!started) return tl::unexpected(started.error());
  dispatcher_.emplace(std::move(*started));
  return {};
}

Result<ChildProcess> Battlefield::start_worker() {
  return ChildProcess::start(
      o_.programs / "flamefield-worker",
      {"--data", o_.directory, "--endpoint", endpoint_, "--threads", "1", "--heartbeat-ms", "100"},
      o_.directory / "log");
}

// The dispatcher may be dead at the moment: asked until it answers.
Result<Message> Battlefield::insist(const Message& question) {
  const bool is_capture =
      std::holds_alternative<PutSet>(question) || std::holds_alternative<PutCapture>(question);
  Result<Message> answer = unavailable("no answer from the dispatcher", "not asked", "");
  for (const auto end = Clock::now() + 60s; Clock::now() < end && !stop_.stop_requested();) {
    answer = (is_capture ? *producer_ : *client_).ask(question, 500ms);
    if (answer || answer.error().code != ErrorCode::Unavailable) break;
  }
  return answer;
}

Result<> Battlefield::prepare() {
  auto keys = KeyRing::open_or_create(o_.directory / "keys");
  if (!keys) return tl::unexpected(keys.error());
  bus_ = std::make_unique<Bus>(*keys);
  port_ = free_port(*bus_);
  if (port_ == 0)
    return unavailable("no free port", "between 20000 and 32000 all are in use", "close programs");
  auto link = SeverableLink::open(port_);
  if (!link) return tl::unexpected(link.error());
  link_ = std::move(*link);
  endpoint_ = concat("tcp://127.0.0.1:", link_->port());
  if (auto ok = start_dispatcher(); !ok) return ok;
  for (int i = 0; i < o_.workers; ++i) {
    auto worker = start_worker();
    if (!worker) return tl::unexpected(worker.error());
    workers_.push_back(std::move(*worker));
  }
  auto client = Client::connect(*bus_, "operator", unique_name("client"), endpoint_);
  if (!client) return tl::unexpected(client.error());
  client_.emplace(std::move(*client));
  auto producer = Client::connect(*bus_, "capture", unique_name("producer"), endpoint_);
  if (!producer) return tl::unexpected(producer.error());
  producer_.emplace(std::move(*producer));
  Dealer dealer(*bus_, "capture", unique_name("capture"));
  if (auto ok = dealer.connect(endpoint_); !ok) return ok;
  sender_.emplace(std::move(dealer), SetSender::Options{.max_unacked = 64, .resend_after = 300ms});

  std::vector<Message> questions = {PutRig{lab_.rig}};
  for (int i = 0; i < 3; ++i) questions.push_back(PutSet{lab_.set("dark", CaptureKind::Dark, i)});
  questions.push_back(LivePlan{true, lab_.processing(o_.iterations)});
  for (const Message& question : questions) {
    if (auto answer = insist(question); !answer) return tl::unexpected(answer.error());
  }
  return {};
}

Result<> Battlefield::thaw(bool all) {
  if (!frozen_ || (!all && Clock::now() < frozen_->second)) return {};
  for (const ChildProcess& worker : workers_) {
    if (worker.pid() == frozen_->first) worker.signal_group(SIGCONT);
  }
  frozen_.reset();
  return {};
}

Result<> Battlefield::strike(Blow blow) {
  ChildProcess& victim = workers_[random_() % workers_.size()];
  switch (blow) {
    case Blow::KillDispatcher:
      ++result.dispatcher_kills;
      return start_dispatcher();
    case Blow::KillWorker: {
      ++result.worker_kills;
      auto next = start_worker();
      if (!next) return tl::unexpected(next.error());
      victim = std::move(*next);  // the old one is killed on the way out
      return {};
    }
    case Blow::Cut:
      ++result.cuts;
      link_->cut();
      return {};
    case Blow::Freeze:
      ++result.freezes;
      victim.signal_group(SIGSTOP);
      frozen_ = {victim.pid(), Clock::now() + 2 * kLease};
      return {};
  }
  return {};
}

Result<> Battlefield::fight(const std::function<void(int)>& progress) {
  const auto waiting = blows(o_, random_);
  std::deque<Blow> left(waiting.begin(), waiting.end());
  const auto started = Clock::now();
  const auto set_due = [&](int set) { return started + std::chrono::duration<double>(set / o_.rate_hz); };
  // Blows fall over the length of the capture; each moment is random within its share of it.
  const double share_s = o_.sets / o_.rate_hz / static_cast<double>(std::max<std::size_t>(left.size(), 1));
  std::uniform_real_distribution<double> within(0.1, 0.9);
  auto next_blow = started + std::chrono::duration<double>(share_s * within(random_));
  int fallen = 0;
  while (result.sets < o_.sets || !left.empty()) {
    if (auto ok = go_on(); !ok) return ok;
    if (result.sets < o_.sets && Clock::now() >= set_due(result.sets) &&
        sender_->offer(lab_.set("burst", CaptureKind::Burst, result.sets)))
      progress(++result.sets);
    sender_->pump(5ms);
    if (auto ok = thaw(false); !ok) return ok;
    if (left.empty() || Clock::now() < next_blow) continue;
    if (left.front() == Blow::Freeze && frozen_) continue;
    if (auto ok = strike(left.front()); !ok) return ok;
    left.pop_front();
    next_blow = started + std::chrono::duration<double>(share_s * (++fallen + within(random_)));
  }
  return {};
}

Result<> Battlefield::wait_until_done() {
  if (auto ok = sender_->drain(120s); !ok) return ok;
  result.sent_again = sender_->resent();
  PutCapture end{"burst", CaptureKind::Burst, 1, 2, o_.sets, {}};
  for (const Camera& camera : lab_.rig.cameras) end.cameras.push_back(camera.name);
  if (auto answer = insist(end); !answer) return tl::unexpected(answer.error());
  std::int64_t before = -1;
  for (auto quiet_since = Clock::now(); Clock::now() < quiet_since + 60s;) {
    if (auto ok = go_on(); !ok) return ok;
    if (auto ok = thaw(false); !ok) return ok;
    const auto answer = insist(GetStatus{});
    if (!answer) return tl::unexpected(answer.error());
    const auto* status = std::get_if<Status>(&*answer);
    if (!status) return invalid_input("answer to GetStatus", "it is of another kind", "");
    if (status->queued + status->leased == 0) return thaw(true);
    if (status->done != before) quiet_since = Clock::now();
    before = status->done;
    std::this_thread::sleep_for(20ms);
  }
  return unavailable("the self-test", "no volume was made for a minute", "see the log");
}

Result<> Battlefield::take_stock() {
  auto reader = LedgerReader::open(o_.directory);
  if (!reader) return tl::unexpected(reader.error());
  const auto receipt = reader->receipt("burst");
  if (!receipt) return tl::unexpected(receipt.error());
  result.balances = receipt->balances() && receipt->sets == o_.sets && receipt->volumes == o_.sets;
  for (const auto& failure : receipt->failures)
    result.problems.push_back(failure.run_id + ": " + failure.reason);
  const auto runs = reader->runs({.limit = 10 * o_.sets});
  if (!runs) return tl::unexpected(runs.error());
  std::map<std::int64_t, int> volumes;  // by set
  for (const RunRow& row : *runs) {
    ++volumes[row.run.inputs.at(0).index];
    if (const auto volume = read_volume(o_.directory / row.run.volume_path); !volume)
      result.problems.push_back(row.run.id + ": " + volume.error().message);
  }
  for (int i = 0; i < o_.sets; ++i) result.lost += volumes[i] == 0;
  // The table could not hold a second one; the diary, written in the same transaction, could.
  const auto diary = reader->events(1'000'000);
  if (!diary) return tl::unexpected(diary.error());
  std::map<std::string, int> commits;
  for (const Event& event : *diary) commits[event.subject] += event.kind == "run-committed";
  for (const auto& [run, count] : commits) result.committed_twice += count > 1;
  return {};
}

}  // namespace

Result<ChaosResult> run_chaos(const ChaosOptions& options, std::stop_token stop,
                              const std::function<void(int offered)>& progress) {
  const auto started = Clock::now();
  Battlefield field(options, std::move(stop));
  const auto fought = field.prepare()
                          .and_then([&] { return field.fight(progress); })
                          .and_then([&] { return field.wait_until_done(); })
                          .and_then([&] { return field.take_stock(); });
  if (!fought) return tl::unexpected(fought.error());
  field.result.wall_s = std::chrono::duration<double>(Clock::now() - started).count();
  return field.result;
}

}  // namespace flamefield
