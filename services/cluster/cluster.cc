#include "services/cluster/cluster.h"

#include <algorithm>
#include <random>

#include "proto/utc.h"
#include "services/bus/keys.h"
#include "services/cluster/pilot_script.h"
#include "services/store/file.h"

namespace flamefield {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kPrefix = "flamefield-";
constexpr std::string_view kLiveSuffix = "-live";

std::string new_name(bool live) {
  return concat(kPrefix, utc_stamp(utc_now_ns()), "-", std::random_device()() % 10'000,
                live ? kLiveSuffix : "");
}

fs::path pilots_of(const ClusterPlace& place) {
  return place.shared_dir / "pilots";
}

Result<> check_endpoint(const std::string& endpoint) {
  const std::string set_it = "set [bus] dispatcher (or [cluster] endpoint), e.g. \"tcp://10.0.0.1:7300\"";
  if (endpoint.empty())
    return invalid_input("no address of the dispatcher", "the nodes of a cluster need one to connect to",
                         set_it);
  if (!endpoint.starts_with("tcp://") || endpoint.find('*') != std::string::npos ||
      endpoint.find("//0.0.0.0") != std::string::npos)
    return invalid_input(concat("dispatcher at ", endpoint), "no node can connect to that", set_it);
  return {};
}

// The pilots write to SHARED/volumes; the dispatcher looks into DATA/volumes.
Result<> check_volumes(const fs::path& data_dir, const fs::path& shared_dir) {
  std::error_code problem;
  if (fs::equivalent(data_dir / "volumes", shared_dir / "volumes", problem)) return {};
  return invalid_input(concat("directory ", shared_dir.string()),
                       "its volumes are not those of the data directory",
                       concat("move them there and 'ln -s ", (shared_dir / "volumes").string(), ' ',
                              (data_dir / "volumes").string(), "'"));
}

std::vector<std::string> worker_arguments(const ClusterPlace& place, const PilotSize& size,
                                          const fs::path& directory, bool live) {
  const ClusterConfig& c = place.config;
  std::vector<std::string> words = {
      directory.string(),
      live ? "live" : "campaign",
      place.worker.string(),
      "--data",
      place.shared_dir.string(),
      "--endpoint",
      place.endpoint,
      "--threads",
      std::to_string(size.cores),
      "--memory-gib",
      concat(static_cast<double>(size.memory_mib) / 1024),
      "--own-memory",
      "--silence-s",
      std::to_string(c.silence_s),
  };
  if (live)
    words.push_back("--live-only");
  else
    words.insert(words.end(), {"--idle-s", std::to_string(c.idle_s)});
  return words;
}

// Directory, key and script of new pilots; the key is on the allow-list.
Result<> equip(const ClusterPlace& place, const Hired& hired) {
  if (auto ok = make_keys_for(place.keys_dir, "worker", hired.directory); !ok) return ok;
  const std::int64_t expires_s = utc_now_ns() / 1'000'000'000 + place.config.key_days * std::int64_t{86'400};
  if (auto ok = allow_key(place.keys_dir, "worker", hired.name, hired.directory / "worker.pub", expires_s);
      !ok)
    return ok;
  if (!place.config.setup.empty()) {
    if (auto ok = write_text_file(hired.directory / "setup.sh", place.config.setup + "\n"); !ok) return ok;
  }
  return write_text_file(hired.directory / "pilot.sh", pilot_script());
}

void take_away(const ClusterPlace& place, const Hired& hired) {
  std::error_code problem;
  (void)revoke_key(place.keys_dir, "worker", hired.name);
  fs::remove_all(hired.directory, problem);
}

}  // namespace

bool Hired::is_alive() const {
  return std::ranges::any_of(pilots, &SlurmJob::is_alive);
}

Result<ClusterPlace> cluster_place(const LabConfig& lab) {
  ClusterPlace place;
  std::error_code problem;
  place.config = lab.cluster;
  place.data_dir = fs::absolute(lab.data_directory, problem).lexically_normal();
  place.keys_dir =
      lab.keys_directory.empty() ? place.data_dir / "keys" : fs::absolute(lab.keys_directory, problem);
  place.shared_dir = lab.cluster.directory.empty()
                         ? place.data_dir
                         : fs::absolute(lab.cluster.directory, problem).lexically_normal();
  place.worker = lab.cluster.worker.empty()
                     ? fs::read_symlink("/proc/self/exe", problem).parent_path() / "flamefield-worker"
                     : fs::path(lab.cluster.worker);
  place.endpoint = lab.cluster.endpoint.empty() ? lab.dispatcher_endpoint : lab.cluster.endpoint;
  if (auto ok = check_endpoint(place.endpoint); !ok) return tl::unexpected(ok.error());
  if (auto ok = check_volumes(place.data_dir, place.shared_dir); !ok) return tl::unexpected(ok.error());
  return place;
}

Result<Hired> hire(const ClusterPlace& place, const PilotSize& size, bool live) {
  const ClusterConfig& c = place.config;
  if (live && c.live_partition.empty())
    return invalid_input("no partition for live work", "[cluster] live_partition is empty",
                         "ask the cluster's administrator for a reserved one, see deploy/slurm");
  Hired hired{.name = new_name(live), .directory = {}, .live = live, .pilots = {}};
  hired.directory = pilots_of(place) / hired.name;
  if (auto ok = equip(place, hired); !ok) {
    take_away(place, hired);
    return tl::unexpected(ok.error());
  }
  PilotArray array;
  array.name = hired.name;
  array.directory = hired.directory;
  array.script = hired.directory / "pilot.sh";
  array.arguments = worker_arguments(place, size, hired.directory, live);
  array.pilots = size.pilots;
  array.cores = size.cores;
  array.memory_mib = size.memory_mib;
  array.minutes = live ? 0 : size.minutes;
  array.drain_s = c.drain_s;
  array.partition = live ? c.live_partition : c.partition;
  array.account = c.account;
  array.constraint = c.constraint;
  array.sbatch = c.sbatch;
  const auto id = submit(array);
  if (!id) {
    take_away(place, hired);
    return tl::unexpected(id.error());
  }
  SlurmJob& job = hired.pilots.emplace_back();
  job.id = *id;
  job.name = hired.name;
  job.state = "PENDING";
  job.partition = array.partition;
  return hired;
}

Result<std::vector<Hired>> all_hired(const ClusterPlace& place) {
  std::vector<Hired> all;
  std::error_code problem;
  for (const auto& entry : fs::directory_iterator(pilots_of(place), problem)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_directory() && name.starts_with(kPrefix))
      all.push_back({name, entry.path(), name.ends_with(kLiveSuffix), {}});
  }
  if (all.empty()) return all;
  std::ranges::sort(all, {}, &Hired::name);
  const auto jobs = jobs_named_like(std::string(kPrefix));
  if (!jobs) return tl::unexpected(jobs.error());
  for (const SlurmJob& job : *jobs) {
    const auto ours = std::ranges::find(all, job.name, &Hired::name);
    if (ours != all.end()) ours->pilots.push_back(job);
  }
  for (Hired& hired : all) std::ranges::sort(hired.pilots, {}, &SlurmJob::task);
  return all;
}

Result<> dismiss(const Hired& hired, bool drain) {
  if (!drain) return cancel(hired.name, Cancel::Now);
  if (auto ok = cancel(hired.name, Cancel::Waiting); !ok) return ok;
  return cancel(hired.name, Cancel::Drain);
}

bool is_over(const Hired& hired, const std::vector<Status::Worker>& connected) {
  return !hired.is_alive() && std::ranges::none_of(connected, [&](const Status::Worker& worker) {
    return worker.name.starts_with(hired.name + "-");
  });
}

void clear_away(const ClusterPlace& place, const Hired& hired) {
  std::error_code problem;
  std::string said;
  for (const auto& entry : fs::directory_iterator(hired.directory, problem)) {
    if (entry.path().extension() != ".log") continue;
    const auto text = read_text_file(entry.path());
    if (text && !text->empty()) said += concat("== ", entry.path().filename().string(), '\n', *text);
  }
  if (!said.empty()) (void)write_text_file(pilots_of(place) / (hired.name + ".log"), said);
  take_away(place, hired);
}

void clear_up(const ClusterPlace& place, const std::vector<Status::Worker>& connected) {
  constexpr std::chrono::minutes kYoung{10};
  const auto all = all_hired(place);
  if (!all) return;  // Slurm is away: another time
  for (const Hired& hired : *all) {
    std::error_code problem;
    const auto age = fs::file_time_type::clock::now() - fs::last_write_time(hired.directory, problem);
    if (!problem && age > kYoung && is_over(hired, connected)) clear_away(place, hired);
  }
}

std::string last_log_line(const Hired& hired, int task) {
  const auto text = read_text_file(hired.directory / concat("pilot-", task, ".log"));
  if (!text) return {};
  const std::size_t end = text->find_last_not_of(" \n");
  if (end == std::string::npos) return {};
  const std::size_t before = text->rfind('\n', end);
  const std::size_t from = before == std::string::npos ? 0 : before + 1;
  return text->substr(from, end + 1 - from);
}

}  // namespace flamefield
