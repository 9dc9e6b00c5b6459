#include "services/study/runner.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <thread>

namespace flamefield {

namespace {

using Clock = std::chrono::steady_clock;

// Runs that cost about the same.
std::string cost_class(const StudyRun& run) {
  return concat(run.settings.recipe.solver, '/', phantom_name(run.settings), '/', run.study);
}

class Pool {
 public:
  Pool(const std::vector<Study>& studies, std::vector<const StudyRun*> runs, const RecordStore& store,
       StudyScenes& scenes, const RunnerOptions& options, std::stop_token stop)
      : studies_(studies),
        runs_(std::move(runs)),
        store_(store),
        scenes_(scenes),
        options_(options),
        relay_(stop, [this] { stop_.request_stop(); }) {}

  Result<RunnerSummary> run() {
    shares_.assign(runs_.size(), 0);
    started_.assign(runs_.size(), {});
    const int cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    int threads = 1;
    for (const StudyRun* run : runs_) threads = std::max(threads, studies_[run->study].threads_per_run);
    jobs_ = std::clamp(options_.jobs > 0 ? options_.jobs : std::max(1, cores / threads), 1,
                       static_cast<int>(std::max<std::size_t>(1, runs_.size())));
    {
      std::vector<std::jthread> workers;
      for (int i = 0; i < jobs_; ++i) workers.emplace_back([this] { work(); });
    }
    if (fatal_) return tl::unexpected(*fatal_);
    summary_.stopped = stop_.stop_requested();
    return summary_;
  }

 private:
  void work() {
    std::shared_ptr<const StudyScene> scene;  // kept for the next run, which is likely to want the same
    for (std::size_t i = next_++; i < runs_.size() && !stop_.stop_requested(); i = next_++) do_one(i, scene);
  }

  void do_one(std::size_t i, std::shared_ptr<const StudyScene>& scene) {
    const StudyRun& run = *runs_[i];
    const int threads = studies_[run.study].threads_per_run;
    {
      const std::lock_guard lock(mutex_);
      started_[i] = Clock::now();
    }
    auto made = scenes_.get(run.settings, threads);
    if (!made) return fail(run, made.error());
    scene = *made;
    auto result = execute(run, *scene, threads, stop_.get_token(), [&](double share) { tell(i, share); });
    if (!result) {
      if (!stop_.stop_requested()) fail(run, result.error());
      return;
    }
    if (studies_[run.study].keep_volumes)
      if (auto ok = store_.put_volume(run.id, result->volume); !ok) return end_all(ok.error());
    if (auto ok = store_.put(result->record); !ok) return end_all(ok.error());
    finish(i, run);
  }

  void finish(std::size_t i, const StudyRun& run) {
    const std::lock_guard lock(mutex_);
    ++summary_.done;
    auto& cost = costs_[cost_class(run)];
    cost.first += std::chrono::duration<double>(Clock::now() - started_[i]).count();
    ++cost.second;
    last_ = run.label();
    shares_[i] = 1;
    report();
  }
  void fail(const StudyRun& run, const Error& error) {
    const std::lock_guard lock(mutex_);
    summary_.failures.push_back({run.label(), error});
  }
  void end_all(const Error& error) {
    const std::lock_guard lock(mutex_);
    if (!fatal_) fatal_ = error;
    stop_.request_stop();
  }
  void tell(std::size_t i, double share) {
    const std::lock_guard lock(mutex_);
    shares_[i] = std::min(share, 0.999);
    report();
  }

  // What a run should take: what its class took, else what all took, else what its progress says.
  double expected_s(std::size_t i) const {
    if (const auto known = costs_.find(cost_class(*runs_[i])); known != costs_.end())
      return known->second.first / known->second.second;
    if (shares_[i] > 0.02)
      return std::chrono::duration<double>(Clock::now() - started_[i]).count() / shares_[i];
    double sum = 0;
    int n = 0;
    for (const auto& [name, cost] : costs_) sum += cost.first, n += cost.second;
    return n > 0 ? sum / n : 0;
  }

  void report() const {
    if (!options_.progress) return;
    double done = 0, left_s = 0;
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      done += shares_[i];
      left_s += (1 - shares_[i]) * expected_s(i);
    }
    options_.progress(done, static_cast<double>(runs_.size()), left_s / jobs_, last_);
  }

  const std::vector<Study>& studies_;
  std::vector<const StudyRun*> runs_;
  const RecordStore& store_;
  StudyScenes& scenes_;
  const RunnerOptions& options_;
  std::stop_source stop_;
  std::stop_callback<std::function<void()>> relay_;
  int jobs_ = 1;
  std::atomic<std::size_t> next_ = 0;
  std::mutex mutex_;  // of all below
  std::vector<double> shares_;
  std::vector<Clock::time_point> started_;
  std::map<std::string, std::pair<double, int>> costs_;
  std::string last_;
  std::optional<Error> fatal_;
  RunnerSummary summary_;
};

}  // namespace

bool is_done(const Study& study, const StudyRun& run, const RecordStore& store) {
  return (!study.keep_volumes || store.has_volume(run.id)) && store.find(run.id).has_value();
}

Result<RunnerSummary> do_runs(const std::vector<Study>& studies, const StudyPlan& plan,
                              const RecordStore& store, StudyScenes& scenes, const RunnerOptions& options,
                              std::stop_token stop) {
  std::vector<const StudyRun*> todo;
  std::map<std::string, bool> wants_volume;  // equal runs may belong to studies that do and do not keep them
  std::set<std::string> known;
  std::size_t skipped = 0;
  for (const StudyRun& run : plan.runs)
    wants_volume[run.id] |= studies[run.study].solve && studies[run.study].keep_volumes;
  for (const StudyRun& run : plan.runs) {
    if (!studies[run.study].solve) continue;
    if (wants_volume[run.id] && !studies[run.study].keep_volumes) continue;  // its twin keeps the volume
    if (!known.insert(run.id).second) continue;
    if (is_done(studies[run.study], run, store)) {
      ++skipped;
    } else {
      todo.push_back(&run);
    }
  }
  auto summary = Pool(studies, std::move(todo), store, scenes, options, std::move(stop)).run();
  if (summary) summary->skipped = skipped;
  return summary;
}

}  // namespace flamefield
