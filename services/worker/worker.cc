#include "services/worker/worker.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <optional>
#include <thread>

#include "proto/version.h"
#include "services/bus/client.h"
#include "services/log/log.h"
#include "services/store/data_id.h"
#include "services/worker/machine.h"

namespace flamefield {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kTick{20}, kJobTick{4};

// Every set over a connection of its own, so that heartbeats never wait behind pixels.
Result<std::vector<FrameSet>> fetch_sets(Client& client, std::span<const SetId> ids, std::stop_token stop,
                                         std::chrono::milliseconds patience) {
  std::vector<FrameSet> sets;
  for (const SetId& id : ids) {
    if (stop.stop_requested()) return unavailable("fetching of sets", "asked to stop", "");
    auto data = client.ask_for<SetData>(FetchSet{id}, patience);
    if (!data) return tl::unexpected(data.error());
    sets.push_back(std::move(data->set));
  }
  return sets;
}

void remove_staged(const std::filesystem::path& data_dir, const Run& run, std::int64_t token) {
  std::error_code problem;
  for (const std::string& path : {run.volume_path, run.projections_path}) {
    if (!path.empty()) std::filesystem::remove(data_dir / staged_path(path, token), problem);
  }
}

}  // namespace

// One connection to the dispatcher, and the job in hand.
class Worker::Session {
 public:
  Session(Worker& worker, Client talk, Client data)
      : worker_(worker),
        options_(worker.options_),
        step_(worker.step_),
        talk_(std::move(talk)),
        data_(std::move(data)) {}

  Result<> run(std::stop_token stop, std::stop_token drain);
  void report_lost_life();

 private:
  Ready credit() const;
  Result<std::optional<Lease>> wait_for_lease(const std::function<bool()>& enough);
  Result<> check_silence() const;
  void work_on(const Lease& lease, std::stop_token stop);
  Result<Run> attempt(const Lease& lease, std::stop_token stop);
  void keep_alive();
  void hand_in(const Lease& lease, const Result<Run>& run);

  Worker& worker_;
  const WorkerOptions& options_;
  const JobStep& step_;
  Client talk_, data_;
  std::mutex mutex_;  // of progress_
  Progress progress_;
  bool lease_lost_ = false;
  Clock::time_point last_work_ = Clock::now(), last_word_ = Clock::now();
};

Worker::Worker(Bus& bus, const WorkerOptions& options, JobStep step)
    : bus_(bus), options_(options), step_(std::move(step)) {
  if (options_.name.empty()) options_.name = unique_name("worker");
  if (options_.memory_mib == 0) options_.memory_mib = memory_of_this_machine_mib();
}

Result<> Worker::run(std::stop_token stop, std::stop_token drain) {
  auto talk = Client::connect(bus_, "worker", options_.name, options_.endpoint);
  if (!talk) return tl::unexpected(talk.error());
  auto data = Client::connect(bus_, "worker", options_.name + ".data", options_.endpoint);
  if (!data) return tl::unexpected(data.error());
  Session session(*this, std::move(*talk), std::move(*data));
  session.report_lost_life();
  return session.run(stop, drain);
}

// The dispatcher would find out by silence, but not whose fault it was. Lost is only the haste: when nobody
// answers, the lease runs out.
void Worker::Session::report_lost_life() {
  if (worker_.lost_.token == 0) return;
  Fail fail{worker_.lost_.token, {}, true};
  fail.error =
      unavailable("the worker's process died of this job", worker_.lost_.reason, "see its log").value();
  (void)talk_.ask(fail, options_.patience);
  worker_.lost_ = {};
}

Result<> Worker::Session::run(std::stop_token stop, std::stop_token drain) {
  const auto idle_for = [&] { return Clock::now() - last_work_; };
  const auto enough = [&] {
    const bool idle = options_.idle_limit.count() > 0 && idle_for() >= options_.idle_limit;
    return idle || stop.stop_requested() || drain.stop_requested();
  };
  while (!enough()) {
    const auto lease = wait_for_lease(enough);
    if (!lease) return tl::unexpected(lease.error());
    if (auto ok = check_silence(); !ok) return ok;
    if (!*lease) continue;
    work_on(**lease, stop);
    last_work_ = last_word_ = Clock::now();
  }
  return {};
}

Ready Worker::Session::credit() const {
  Ready ready{options_.name, std::string(program_version()), options_.threads};
  ready.host = host_name();
  ready.cores = std::max(1u, std::thread::hardware_concurrency());
  ready.memory_mib = options_.memory_mib;
  if (!options_.data_dir.empty()) ready.data_id = read_data_id(options_.data_dir);
  ready.live_only = options_.live_only;
  ready.own_memory = options_.own_memory;
  return ready;
}

// One Ready is one credit. It is repeated while idle, since a restarted dispatcher knows nobody; then an
// answer is asked for, to know that there is one.
Result<std::optional<Lease>> Worker::Session::wait_for_lease(const std::function<bool()>& enough) {
  const bool repeated = Clock::now() - last_work_ >= options_.heartbeat;
  (void)(repeated ? talk_.post(credit()) : talk_.tell(credit()));
  const auto again = Clock::now() + options_.heartbeat;
  while (!enough() && Clock::now() < again) {
    auto message = talk_.next(kTick);
    if (!message) continue;
    last_word_ = Clock::now();
    if (auto* lease = std::get_if<Lease>(&*message)) return std::optional(std::move(*lease));
    // A dispatcher with a full disk takes nobody for now; another version it never will.
    const auto* no = std::get_if<Rejected>(&*message);
    if (no && no->error.code == ErrorCode::InvalidInput) return tl::unexpected(no->error);
  }
  return std::optional<Lease>();
}

Result<> Worker::Session::check_silence() const {
  if (options_.silence_limit.count() == 0 || Clock::now() - last_word_ < options_.silence_limit) return {};
  return unavailable(
      concat("worker ", options_.name, " heard nothing of the dispatcher for ",
             options_.silence_limit.count(), " s"),
      concat(options_.endpoint, " is away, or this worker's key was revoked or is out of date"),
      "is the dispatcher running, and does 'flamefield keys list' show the key?");
}

void Worker::Session::work_on(const Lease& lease, std::stop_token stop) {
  progress_ = Progress{lease.token, lease.job.run_id, "fetch", 0, 0, 0, 0};
  lease_lost_ = false;
  *worker_.in_hand_ = lease.token;
  std::stop_source job_stop;
  const std::stop_callback pass_on(stop, [&] { job_stop.request_stop(); });
  Result<Run> result = unavailable("job", "not started", "");
  std::atomic<bool> finished = false;
  std::jthread job([&] {
    result = attempt(lease, job_stop.get_token());
    finished = true;
  });
  auto next_beat = Clock::now() + options_.heartbeat;
  while (!finished) {
    if (auto message = talk_.next(kJobTick)) {
      const auto* lost = std::get_if<LeaseLost>(&*message);
      if (lost && lost->token == lease.token) {
        lease_lost_ = true;
        job_stop.request_stop();
      }
    }
    if (Clock::now() < next_beat) continue;
    keep_alive();
    next_beat = Clock::now() + options_.heartbeat;
  }
  job.join();
  *worker_.in_hand_ = 0;
  hand_in(lease, result);
}

void Worker::Session::keep_alive() {
  const std::lock_guard lock(mutex_);
  (void)talk_.tell(Heartbeat{progress_});
}

Result<Run> Worker::Session::attempt(const Lease& lease, std::stop_token stop) {
  JobContext context{
      lease, options_.name,
      [&](std::span<const SetId> ids) { return fetch_sets(data_, ids, stop, options_.patience); },
      [&](const Progress& progress) {
        const std::lock_guard lock(mutex_);
        progress_ = progress;
        progress_.token = lease.token;
        progress_.run_id = lease.job.run_id;
      },
      stop};
  // A step that throws must not take the worker, or the job, with it.
  try {
    return step_(context);
  } catch (const std::bad_alloc&) {
    return unavailable(concat("run ", lease.job.run_id), "out of memory",
                       "use a smaller grid or more memory");
  } catch (const std::exception& problem) {
    return invalid_input(concat("run ", lease.job.run_id), problem.what(), "report this as a defect");
  }
}

// The dispatcher may be away for a moment: the result is offered until it answers or patience ends.
void Worker::Session::hand_in(const Lease& lease, const Result<Run>& run) {
  const auto give_up = Clock::now() + options_.patience;
  Message message = Accepted{};
  if (run)
    message = Finish{lease.token, *run};
  else
    message = Fail{lease.token, run.error()};
  Result<Message> answer = unavailable("result", "the lease was lost", "drop it");
  while (!lease_lost_ && Clock::now() < give_up) {
    answer = talk_.ask(message, std::min(options_.patience, std::chrono::milliseconds(2'000)));
    if (answer || answer.error().code != ErrorCode::Unavailable) break;
  }
  const char* event = run && answer ? "job-finished" : run ? "result-dropped" : "job-given-back";
  log_event(run && answer ? LogLevel::Info : LogLevel::Warning, event,
            {{"run", lease.job.run_id},
             {"token", lease.token},
             {"why", !run      ? run.error().message
                     : !answer ? answer.error().message
                               : std::string()}});
  if (run && !answer) remove_staged(options_.data_dir, *run, lease.token);
}

}  // namespace flamefield
