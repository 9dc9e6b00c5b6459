// A dispatcher with thousands of light workers: how fast they connect, how many small jobs a second it hands
// out and commits, whether all stay alive, and what it needs for that.
//   cmake --build --preset release --target bench_dispatcher
//   build/release/bin/bench_dispatcher --workers 1000 --jobs 40000
//   build/release/bin/bench_dispatcher --workers 5000 --jobs 0
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>
#include <fstream>
#include <iostream>
#include <memory>
#include <random>
#include <thread>

#include "proto/version.h"
#include "services/bus/client.h"
#include "services/bus/keys.h"
#include "services/process/signals.h"
#include "services/selftest/child_process.h"
#include "services/selftest/miniature.h"
#include "tests/support/scratch.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

struct Options {
  int workers = 1000;
  int jobs = 40'000;
  int threads = 1;     // that simulate the workers
  int slow = 20;       // workers that take so long over a job that only heartbeats keep it
  double slow_s = 25;  // more than two leases
  std::string data;
};

struct Counts {
  std::atomic<std::int64_t> done = 0, lost = 0, refused = 0, heartbeats = 0;
};

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// One worker: two connections as the real one has, and no mathematics.
class LightWorker {
 public:
  LightWorker(Bus& bus, const std::string& endpoint, std::filesystem::path data_dir, std::string name,
              std::chrono::duration<double> work)
      : data_dir_(std::move(data_dir)),
        name_(std::move(name)),
        work_(std::chrono::duration_cast<Clock::duration>(work)),
        talk_(bus, "worker", name_),
        data_(bus, "worker", name_ + ".data") {
    if (!talk_.connect(endpoint) || !data_.connect(endpoint)) throw std::runtime_error("cannot connect");
  }

  // True when something happened.
  bool turn(Counts& counts) {
    const auto now = Clock::now();
    if (!lease_ && now >= next_word_) say_ready(now);
    if (lease_ && now >= next_word_) {
      (void)talk_.send(Heartbeat{{.token = lease_->token, .run_id = lease_->job.run_id, .stage = "solve"}});
      ++counts.heartbeats;
      next_word_ = now + kHeartbeat;
    }
    if (lease_ && !finishing_ && now >= ends_) finish();
    auto delivery = talk_.receive(0ms);
    if (!delivery || !delivery->message) return false;
    if (auto* lease = std::get_if<Lease>(&*delivery->message)) {
      lease_ = std::move(*lease);
      ends_ = now + work_;
      next_word_ = now + kHeartbeat;
      finishing_ = false;
      if (work_.count() == 0) finish();
    } else if (std::holds_alternative<Committed>(*delivery->message)) {
      ++counts.done;
      lease_.reset();
      say_ready(now);
    } else if (std::holds_alternative<LeaseLost>(*delivery->message)) {
      ++counts.lost;
      lease_.reset();
    } else if (std::holds_alternative<Rejected>(*delivery->message)) {
      ++counts.refused;
      lease_.reset();
    }
    return true;
  }

 private:
  static constexpr auto kHeartbeat = 1s;

  void say_ready(Clock::time_point now) {
    Ready ready{name_, std::string(program_version()), 1};
    ready.host = name_;
    ready.memory_mib = 1000;
    (void)talk_.send(ready);
    next_word_ = now + kHeartbeat;
  }
  void finish() {
    Run run;
    run.id = lease_->job.run_id;
    run.job_id = lease_->job.id;
    run.inputs = lease_->job.inputs;
    run.processing = lease_->job.processing;
    run.program_version = lease_->job.program_version;
    run.solver = run.processing.recipe.solver;
    run.worker = name_;
    run.volume_path = "volumes/" + run.id + ".vtkhdf";
    std::ofstream(data_dir_ / staged_path(run.volume_path, lease_->token));
    (void)talk_.send(Finish{lease_->token, run}, ++request_);
    finishing_ = true;
  }

  std::filesystem::path data_dir_;
  std::string name_;
  Clock::duration work_;
  Dealer talk_, data_;
  std::optional<Lease> lease_;
  bool finishing_ = false;
  std::uint64_t request_ = 0;
  Clock::time_point ends_, next_word_;
};

struct ProcessFigures {
  double rss_mib = 0, cpu_s = 0;
};
ProcessFigures figures_of(int pid) {
  ProcessFigures out;
  std::ifstream status(concat("/proc/", pid, "/status"));
  for (std::string word; status >> word;) {
    if (word == "VmRSS:" && status >> out.rss_mib) out.rss_mib /= 1024;
  }
  std::ifstream stat(concat("/proc/", pid, "/stat"));
  std::string text;
  std::getline(stat, text);
  std::istringstream fields(text.substr(text.rfind(')') + 2));
  double user = 0, system = 0;
  for (int i = 3; i < 14; ++i) fields >> text;
  fields >> user >> system;
  out.cpu_s = (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  return out;
}

class Bench {
 public:
  Bench(const Options& options, std::stop_token stop)
      : o_(options),
        stop_(std::move(stop)),
        data_(o_.data.empty() ? scratch_.path() : std::filesystem::path(o_.data)),
        keys_(KeyRing::open_or_create(data_ / "keys").value()),
        bus_(keys_) {}

  int run() {
    start_dispatcher();
    if (o_.jobs > 0) put_in_line();
    if (!connect()) return 1;
    return o_.jobs > 0 ? hand_out() : 0;
  }

 private:
  void start_dispatcher() {
    std::random_device random;
    endpoint_ = concat("tcp://127.0.0.1:", 20'000 + random() % 12'000);
    dispatcher_.emplace(ChildProcess::start(std::filesystem::read_symlink("/proc/self/exe").parent_path() /
                                                "flamefield-dispatchd",
                                            {"--data", data_.string(), "--endpoint", endpoint_},
                                            data_ / "log")
                            .value());
    client_.emplace(Client::connect(bus_, "operator", unique_name("bench"), endpoint_).value());
  }
  template <class Answer>
  Answer ask(const Message& question) {
    return client_->ask_for<Answer>(question, 120s).value();
  }
  // Many recipes for a few sets, held until all workers are there.
  void put_in_line() {
    constexpr int kSets = 200;
    const Miniature lab;
    auto capture = Client::connect(bus_, "capture", unique_name("bench"), endpoint_).value();
    ask<RigStored>(PutRig{lab.rig});
    (void)capture.ask(PutSet{lab.set("dark", CaptureKind::Dark, 0)}, 60s).value();
    for (int i = 0; i < kSets; ++i)
      (void)capture.ask(PutSet{lab.set("burst", CaptureKind::Burst, i)}, 60s).value();
    ask<JobsControlled>(ControlJobs{.action = JobAction::Pause, .all = true});
    Submit order;
    order.captures = {"burst"};
    order.priority = Priority::Scheduled;
    for (int placed = 0; placed < o_.jobs; placed += kSets) {
      order.processing = lab.processing(1 + placed / kSets);
      ask<Submitted>(order);
    }
  }
  bool connect() {
    const auto started = Clock::now();
    for (int t = 0; t < o_.threads; ++t)
      threads_.emplace_back([this, t](std::stop_token end) { simulate(t, end); });
    while (!stop_.stop_requested() && seconds_since(started) < 120) {
      const Status status = ask<Status>(GetStatus{});
      if (std::ssize(status.workers) == o_.workers) {
        std::cout << o_.workers << " workers (" << 2 * o_.workers << " connections) connected in "
                  << seconds_since(started) << " s; dispatcher " << figures_of(dispatcher_->pid()).rss_mib
                  << " MiB\n";
        return true;
      }
      std::this_thread::sleep_for(100ms);
    }
    std::cerr << "not all workers connected\n";
    return false;
  }
  void simulate(int thread, std::stop_token end) {
    std::vector<std::unique_ptr<LightWorker>> workers;
    for (int i = thread; i < o_.workers; i += o_.threads)
      workers.push_back(
          std::make_unique<LightWorker>(bus_, endpoint_, data_, concat("light-", i),
                                        std::chrono::duration<double>(i < o_.slow ? o_.slow_s : 0)));
    while (!end.stop_requested()) {
      bool any = false;
      for (auto& worker : workers) any = worker->turn(counts_) || any;
      if (!any) std::this_thread::sleep_for(1ms);
    }
  }
  int hand_out() {
    const int quick = o_.jobs - o_.slow;
    const ProcessFigures before = figures_of(dispatcher_->pid());
    ask<JobsControlled>(ControlJobs{.action = JobAction::Resume, .all = true});
    const auto started = Clock::now();
    double quarter_rss_mib = 0, seconds = 0;
    ProcessFigures after;
    while (!stop_.stop_requested() && counts_.done < o_.jobs && seconds_since(started) < 300) {
      if (quarter_rss_mib == 0 && counts_.done > o_.jobs / 4)
        quarter_rss_mib = figures_of(dispatcher_->pid()).rss_mib;
      if (seconds == 0 && counts_.done >= quick - o_.slow) {
        seconds = seconds_since(started);
        after = figures_of(dispatcher_->pid());
        std::cout << counts_.done << " jobs in " << seconds
                  << " s: " << static_cast<double>(counts_.done) / seconds << " a second; dispatcher "
                  << (after.cpu_s - before.cpu_s) * 1e3 / static_cast<double>(counts_.done)
                  << " ms of CPU a job, " << quarter_rss_mib << " MiB after a quarter, " << after.rss_mib
                  << " at the end\n";
      }
      std::this_thread::sleep_for(5ms);
    }
    const Status status = ask<Status>(GetStatus{});
    const auto counter = [&](const char* name) {
      const auto found = status.counters.find(name);
      return found == status.counters.end() ? 0 : found->second;
    };
    std::cout << status.done << " done, " << counts_.lost << " leases lost, " << counts_.refused
              << " refused, " << counter("leases_expired") << " expired, " << counts_.heartbeats
              << " heartbeats; " << o_.slow << " workers held a job for " << o_.slow_s << " s\n";
    return counts_.lost == 0 && status.done == o_.jobs ? 0 : 1;
  }

  Options o_;
  std::stop_token stop_;
  Scratch scratch_;
  std::filesystem::path data_;
  KeyRing keys_;
  Bus bus_;
  std::string endpoint_;
  std::optional<ChildProcess> dispatcher_;
  std::optional<Client> client_;
  Counts counts_;
  std::vector<std::jthread> threads_;
};

}  // namespace
}  // namespace flamefield

int main(int argc, char** argv) {
  using namespace flamefield;
  const SignalStop stop;
  CLI::App app("A dispatcher with thousands of light workers", "bench_dispatcher");
  Options options;
  app.add_option("--workers", options.workers)->capture_default_str();
  app.add_option("--jobs", options.jobs, "a multiple of 200; 0: only connect")->capture_default_str();
  app.add_option("--threads", options.threads, "that simulate the workers")->capture_default_str();
  app.add_option("--slow", options.slow, "workers whose jobs outlast two leases")->capture_default_str();
  app.add_option("--data", options.data, "data directory (default: a scratch one)");
  CLI11_PARSE(app, argc, argv);
  rlimit files{};
  if (::getrlimit(RLIMIT_NOFILE, &files) == 0) {
    files.rlim_cur = files.rlim_max;
    ::setrlimit(RLIMIT_NOFILE, &files);
  }
  return Bench(options, stop.token()).run();
}
