#include "services/cluster/slurm.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <thread>

#include "services/process/run_program.h"

namespace flamefield {

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kPatience = 60s;    // for one program: Slurm's own tools wait for the controller
constexpr auto kKeepTrying = 60s;  // for a submission
constexpr auto kBetweenTries = 1s;

// Of what a program of Slurm said, the part that names the cause.
std::string last_words(const std::string& err) {
  std::string text = err.substr(0, err.find_last_not_of(" \n") + 1);
  text = text.substr(text.rfind('\n') == std::string::npos ? 0 : text.rfind('\n') + 1);
  for (const std::string_view prefix :
       {"sbatch: error: ", "squeue: error: ", "scancel: error: ", "sinfo: error: ",
        "Batch job submission failed: ", "slurm_load_jobs error: "}) {
    if (text.starts_with(prefix)) text = text.substr(prefix.size());
  }
  return text.empty() ? "it gave no reason" : text;
}

// The controller is away, and may come back.
bool is_passing(const std::string& err) {
  return std::ranges::any_of(
      std::initializer_list<std::string_view>{"Unable to contact slurm controller", "timed out",
                                              "Connection refused", "connect failure", "temporarily unable",
                                              "Resource temporarily", "Zero Bytes were transmitted"},
      [&](std::string_view sign) { return err.find(sign) != std::string::npos; });
}

Result<std::string> run(const std::vector<std::string>& command) {
  auto output = run_program(command, kPatience);
  if (!output && output.error().code == ErrorCode::NotFound)
    return not_found(concat("no ", command[0]), "this machine has none of Slurm's programs in PATH",
                     "install them (Debian: slurm-client), or use '--executor local'");
  if (!output) return tl::unexpected(output.error());
  if (output->exit_code == 0) return std::move(output->out);
  if (is_passing(output->err))
    return unavailable(concat(command[0], " has no answer"), last_words(output->err),
                       "is slurmctld running? see 'scontrol ping'");
  return invalid_input(concat(command[0], " refused"), last_words(output->err),
                       "mend [cluster] in lab.toml, or ask the cluster's administrator");
}

Result<std::int64_t> array_id(const std::string& out) {
  std::int64_t id = 0;  // "123" or "123;cluster"
  if (std::from_chars(out.data(), out.data() + out.size(), id).ec == std::errc() && id > 0) return id;
  return invalid_input("answer of sbatch", concat("'", out, "' holds no job id"), "is this Slurm's sbatch?");
}

}  // namespace

bool SlurmJob::is_alive() const {
  return std::ranges::any_of(
      std::initializer_list<std::string_view>{"PENDING", "RUNNING", "COMPLETING", "CONFIGURING", "SUSPENDED",
                                              "REQUEUED", "REQUEUE_HOLD", "RESIZING", "SIGNALING",
                                              "STAGE_OUT", "STOPPED"},
      [&](std::string_view alive) { return state == alive; });
}

std::vector<std::string> sbatch_command(const PilotArray& a) {
  std::vector<std::string> words = {"sbatch", "--parsable", "--job-name=" + a.name,
                                    concat("--array=1-", a.pilots), "--nodes=1", "--ntasks=1",
                                    concat("--cpus-per-task=", a.cores), concat("--mem=", a.memory_mib, "M"),
                                    concat("--signal=B:USR1@", a.drain_s), "--requeue",
                                    // Nothing of the submitter's environment, which may hold secrets.
                                    "--export=NIL", "--open-mode=append", "--chdir=" + a.directory.string(),
                                    "--output=" + (a.directory / "pilot-%a.log").string()};
  if (a.minutes > 0) words.push_back(concat("--time=", a.minutes));
  if (!a.partition.empty()) words.push_back("--partition=" + a.partition);
  if (!a.account.empty()) words.push_back("--account=" + a.account);
  if (!a.constraint.empty()) words.push_back("--constraint=" + a.constraint);
  words.insert(words.end(), a.sbatch.begin(), a.sbatch.end());
  words.push_back(a.script.string());
  words.insert(words.end(), a.arguments.begin(), a.arguments.end());
  return words;
}

Result<std::int64_t> submit(const PilotArray& array) {
  for (const auto deadline = Clock::now() + kKeepTrying;;) {
    const auto out = run(sbatch_command(array));
    if (out) return array_id(*out);
    if (out.error().code != ErrorCode::Unavailable) return tl::unexpected(out.error());
    // It may have been accepted, and only the answer was lost.
    const auto known = jobs_named(array.name);
    if (known && !known->empty()) return known->front().id;
    if (Clock::now() >= deadline) return tl::unexpected(out.error());
    std::this_thread::sleep_for(kBetweenTries);
  }
}

Result<std::vector<SlurmJob>> jobs_named_like(const std::string& prefix) {
  const auto out = run({"squeue", "--all", "--json"});
  if (!out) return tl::unexpected(out.error());
  auto jobs = read_squeue(*out);
  if (jobs) std::erase_if(*jobs, [&](const SlurmJob& job) { return !job.name.starts_with(prefix); });
  return jobs;
}

Result<std::vector<SlurmJob>> jobs_named(const std::string& name) {
  auto jobs = jobs_named_like(name);
  if (jobs) std::erase_if(*jobs, [&](const SlurmJob& job) { return job.name != name; });
  return jobs;
}

Result<> cancel(const std::string& name, Cancel how) {
  std::vector<std::string> words = {"scancel", "--name=" + name};
  if (how == Cancel::Waiting) words.push_back("--state=PENDING");
  if (how == Cancel::Drain) words.insert(words.end(), {"--state=RUNNING", "--batch", "--signal=USR1"});
  const auto out = run(words);
  if (!out) return tl::unexpected(out.error());
  return {};
}

Result<std::string> partition_state(const std::string& partition) {
  if (partition.empty()) return std::string();
  const auto out = run({"sinfo", "--all", "--noheader", "--format=%R %a"});
  if (!out) return tl::unexpected(out.error());
  std::string names;
  for (std::size_t from = 0; from < out->size();) {
    const std::size_t end = std::min(out->find('\n', from), out->size());
    const std::string line = out->substr(from, end - from);
    const std::size_t space = line.find(' ');
    from = end + 1;
    if (space == std::string::npos) continue;
    if (line.substr(0, space) == partition) return line.substr(space + 1);
    names += (names.empty() ? "" : ", ") + line.substr(0, space);
  }
  return not_found(concat("partition '", partition, "'"), "Slurm has none of this name",
                   concat("use one of ", names));
}

}  // namespace flamefield
