#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>
#include <thread>

#include "services/cli/cluster_options.h"
#include "services/cli/commands.h"
#include "services/ledger/reader.h"

namespace flamefield {

namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;

struct Options {
  DataOption data;
  CLI::App* command = nullptr;
  ClusterOptions cluster;
  std::string name;
  bool live = false, drain = false, watch = false, json = false;

  ClusterPlace place() { return cluster.place(data, command->count("--data") > 0); }
};

Status status_of(const DataOption& data) {
  DispatcherConnection connection = connect_to_dispatcher(data);
  return or_fail(connection.client.ask_for<Status>(GetStatus{}, 10s));
}

// What waits, and what such work took lately.
PilotWork work_in_line(const DataOption& data, const Status& status) {
  constexpr std::size_t kNewest = 50;
  PilotWork work{.volumes = status.queued + status.leased};
  auto ledger = or_fail(LedgerReader::open(data.dir));
  std::vector<double> times;
  for (const RunRow& row : or_fail(ledger.runs({.limit = kNewest}))) {
    const RunTimings& t = row.run.timings;
    times.push_back(t.fetch_s + t.prepare_s + t.solve_s + t.write_s);
    work.peak_rss_mib = std::max(work.peak_rss_mib, row.run.peak_rss_mib);
  }
  if (times.empty()) return work;
  const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
  std::ranges::nth_element(times, middle);
  work.seconds = *middle * static_cast<double>(work.volumes);
  return work;
}

void up(Options& options) {
  const ClusterPlace place = options.place();
  const Status status = status_of(options.data);
  PilotWork work = work_in_line(options.data, status);
  if (options.live) work.volumes = std::max<std::int64_t>(work.volumes, 1);
  if (work.volumes == 0 && !options.cluster.pilots)
    throw CommandFailure{ExitCode::Failed,
                         "nothing is in line (pilots would end at once) submit work first, or "
                         "name a number with --pilots"};
  const PilotSize size = options.cluster.size(work, place.config);
  const Hired hired = hire_pilots(place, size, options.live, status.workers);
  if (!options.json) {
    std::cout << text_of(hired, size) << '\n';
    return;
  }
  std::cout << Json{{"name", hired.name},
                    {"slurm_id", hired.pilots.front().id},
                    {"pilots", size.pilots},
                    {"cores", size.cores},
                    {"memory_mib", size.memory_mib},
                    {"minutes", hired.live ? Json(nullptr) : Json(size.minutes)},
                    {"seconds_left", size.seconds_left}}
                   .dump(2)
            << '\n';
}

// --- status: our queue beside Slurm's

// "flamefield-...-3" and, started again, "flamefield-...-3.1".
const Status::Worker* worker_of(const Status& status, const Hired& hired, int task) {
  const std::string name = concat(hired.name, "-", task);
  const Status::Worker* newest = nullptr;
  for (const auto& worker : status.workers) {
    const bool is_its = worker.name == name || worker.name.starts_with(name + ".");
    if (is_its && (!newest || worker.silent_s < newest->silent_s)) newest = &worker;
  }
  return newest;
}

// Why no pilot works, where none does: the answer to our queue's "no worker connected".
std::string why_no_pilot(const std::vector<Hired>& all) {
  std::size_t waiting = 0;
  std::string reason;
  for (const Hired& hired : all) {
    for (const SlurmJob& job : hired.pilots) {
      if (!job.is_pending()) continue;
      ++waiting;
      if (reason.empty()) reason = explain(job);
    }
  }
  if (waiting == 0) return "no pilots are hired: 'flamefield cluster up'";
  return concat("pilots wait in Slurm: ", reason.empty() ? "no reason given yet" : reason);
}

std::string why(const std::string& ours, const std::vector<Hired>& all) {
  return ours.starts_with("no worker connected") ? concat(ours, "; ", why_no_pilot(all)) : ours;
}

std::string doing(const Hired& hired, const SlurmJob& job, const Status& status) {
  if (const auto* worker = worker_of(status, hired, job.task))
    return worker->job_id == 0 ? "idle" : fmt::format("on job {}", worker->job_id);
  if (job.is_pending()) return explain(job);
  const std::string said = last_log_line(hired, job.task);
  const std::string reason = explain(job);
  if (said.empty()) return job.is_alive() ? "starting" : reason;
  return reason.empty() ? said : concat(reason, ": ", said);
}

Json json_of(const Hired& hired, const Status& status) {
  Json pilots = Json::array();
  for (const SlurmJob& job : hired.pilots) {
    const auto* worker = worker_of(status, hired, job.task);
    pilots.push_back({{"task", job.task == 0 && !job.tasks.empty() ? Json(job.tasks) : Json(job.task)},
                      {"slurm_id", job.id},
                      {"state", job.state},
                      {"reason", job.reason},
                      {"why", explain(job)},
                      {"partition", job.partition},
                      {"node", job.nodes},
                      {"worker", worker ? Json(worker->name) : Json(nullptr)},
                      {"job", worker && worker->job_id != 0 ? Json(worker->job_id) : Json(nullptr)},
                      {"doing", doing(hired, job, status)}});
  }
  return {
      {"name", hired.name}, {"live", hired.live}, {"alive", hired.is_alive()}, {"pilots", std::move(pilots)}};
}

void print(const Status& status, const std::vector<Hired>& all, const std::vector<Event>& refused,
           bool json) {
  if (json) {
    Json campaigns = Json::array(), waiting = Json::array(), turned_away = Json::array();
    for (const Hired& hired : all) campaigns.push_back(json_of(hired, status));
    for (const auto& job : status.waiting)
      waiting.push_back({{"job", job.job_id}, {"why", why(job.why, all)}});
    for (const Event& event : refused)
      turned_away.push_back({{"worker", event.subject}, {"why", event.text}});
    std::cout << Json{{"queued", status.queued},
                      {"leased", status.leased},
                      {"done", status.done},
                      {"failed", status.failed},
                      {"workers", status.workers.size()},
                      {"campaigns", std::move(campaigns)},
                      {"waiting", std::move(waiting)},
                      {"refused", std::move(turned_away)}}
                     .dump(2)
              << std::endl;
    return;
  }
  std::cout << fmt::format("jobs       {} waiting, {} running, {} done, {} failed; {} workers connected\n",
                           status.queued, status.leased, status.done, status.failed, status.workers.size());
  for (const Hired& hired : all) {
    std::cout << fmt::format("\n{}{}\n", hired.name, hired.live ? " (live work alone)" : "");
    if (hired.pilots.empty()) std::cout << "  Slurm knows nothing of it any more\n";
    for (const SlurmJob& job : hired.pilots)
      std::cout << fmt::format("  {:<6} {:<10} {:<12} {:<12} {}\n",
                               job.task == 0 && !job.tasks.empty() ? job.tasks : std::to_string(job.task),
                               job.id, job.state, job.nodes.empty() ? "-" : job.nodes,
                               doing(hired, job, status));
  }
  if (!status.waiting.empty()) std::cout << '\n';
  for (const auto& job : status.waiting)
    std::cout << fmt::format("job {:<6} waits: {}\n", job.job_id, why(job.why, all));
  for (const Event& event : refused)
    std::cout << fmt::format("refused    {}: {}\n", event.subject, event.text);
}

// Workers of these pilots that the dispatcher turned away.
std::vector<Event> refusals(const DataOption& data, const std::vector<Hired>& all) {
  constexpr std::int64_t kLooked = 200;
  std::vector<Event> found;
  auto ledger = or_fail(LedgerReader::open(data.dir));
  for (Event& event : or_fail(ledger.events(kLooked))) {
    const bool is_ours = std::ranges::any_of(
        all, [&](const Hired& hired) { return event.subject.starts_with(hired.name + "-"); });
    if (event.kind == "worker-refused" && is_ours) found.push_back(std::move(event));
  }
  return found;
}

void status(Options& options, const Session& session) {
  const ClusterPlace place = options.place();
  do {
    const Status now = status_of(options.data);
    const std::vector<Hired> all = or_usage(all_hired(place));
    if (options.watch && !options.json) std::cout << "\033[H\033[J";
    print(now, all, refusals(options.data, all), options.json);
    if (options.watch) std::this_thread::sleep_for(2s);
  } while (options.watch && !session.stop().stop_requested());
}

// --- down

void down(Options& options, const Session& session) {
  const ClusterPlace place = options.place();
  std::vector<Hired> all = or_usage(all_hired(place));
  if (!options.name.empty())
    std::erase_if(all, [&](const Hired& hired) { return hired.name != options.name; });
  if (all.empty() && !options.name.empty())
    throw CommandFailure{ExitCode::Usage,
                         concat("no pilots named '", options.name,
                                "' (there is no such directory) see 'flamefield cluster status'")};
  for (const Hired& hired : all) {
    if (hired.is_alive()) or_usage(dismiss(hired, options.drain));
  }
  std::size_t left = all.size();
  const auto give_up = std::chrono::steady_clock::now() + 60s;
  while (!options.drain && left > 0 && std::chrono::steady_clock::now() < give_up) {
    session.check_stop();
    left =
        static_cast<std::size_t>(std::ranges::count_if(or_usage(all_hired(place)), [&](const Hired& hired) {
          return hired.is_alive() && std::ranges::find(all, hired.name, &Hired::name) != all.end();
        }));
    if (left > 0) std::this_thread::sleep_for(500ms);
  }
  // A key that is taken away ends what Slurm forgot, too.
  if (!options.drain) {
    for (const Hired& hired : all) clear_away(place, hired);
  }
  if (options.json) {
    Json names = Json::array();
    for (const Hired& hired : all) names.push_back(hired.name);
    std::cout << Json{{"dismissed", names}, {"left", options.drain ? all.size() : left}}.dump(2) << '\n';
    return;
  }
  for (const Hired& hired : all)
    std::cout << hired.name
              << (options.drain ? ": finishes what it has in hand\n" : ": gone, its key is revoked\n");
  if (all.empty()) std::cout << "no pilots are hired\n";
}

CLI::App* sub(CLI::App& parent, Session& session, const char* name, const char* help, const char* example,
              const std::shared_ptr<Options>& options, std::function<void(Options&)> work) {
  auto* command = parent.add_subcommand(name, help);
  options->command = command;
  add_data(*command, options->data);
  add_cluster_place(*command, options->cluster);
  command->add_flag("--json", options->json, "Print as JSON");
  command->footer(concat("Example:\n  flamefield cluster ", example));
  command->callback([=, &session] { session.choose([=] { work(*options); }); });
  return command;
}

}  // namespace

void add_cluster(CLI::App& app, Session& session) {
  auto* cluster =
      app.add_subcommand("cluster", "Workers as jobs of Slurm: pilots, which pull work over the bus");
  cluster->require_subcommand(1);
  auto options = std::make_shared<Options>();
  auto* rising = sub(*cluster, session, "up", "Submit pilots for the work in line, or for live work",
                     "up --config lab.toml --pilots 8", options, [](Options& o) { up(o); });
  add_cluster_size(*rising, options->cluster);
  rising->add_flag("--live", options->live,
                   "Into [cluster] live_partition, for live work alone, until 'down'");

  options = std::make_shared<Options>();
  sub(*cluster, session, "status", "Our queue beside Slurm's: who works, and why the others wait",
      "status --config lab.toml", options, [&session](Options& o) { status(o, session); })
      ->add_flag("--watch", options->watch, "Repeat until Ctrl-C");

  options = std::make_shared<Options>();
  auto* falling =
      sub(*cluster, session, "down", "Dismiss pilots; what they had in hand is done by others",
          "down --config lab.toml --drain", options, [&session](Options& o) { down(o, session); });
  falling->add_option("NAME", options->name, "Only these (default: all)");
  falling->add_flag("--drain", options->drain, "Let them finish what they have in hand");
}

}  // namespace flamefield
