// What `squeue --json` says. Slurm 22.05 writes numbers and names; from 23.02 on numbers that may be unset
// are
// {"set", "infinite", "number"}, and a state is a list of names.
#include <nlohmann/json.hpp>

#include "services/cluster/slurm.h"

namespace flamefield {

namespace {

using Json = nlohmann::json;

std::int64_t number(const Json& job, const char* key) {
  const auto found = job.find(key);
  if (found == job.end()) return 0;
  if (found->is_number_integer()) return found->get<std::int64_t>();
  if (found->is_object() && found->value("set", false) && !found->value("infinite", false))
    return number(*found, "number");
  return 0;
}

std::string text(const Json& job, const char* key) {
  const auto found = job.find(key);
  if (found == job.end()) return {};
  if (found->is_string()) return found->get<std::string>();
  if (found->is_array() && !found->empty() && found->front().is_string())
    return found->front().get<std::string>();
  return {};
}

// "RUNNING", or "COMPLETING" where that is one of several states.
std::string state_of(const Json& job) {
  const auto found = job.find("job_state");
  if (found != job.end() && found->is_array()) {
    for (const Json& state : *found) {
      if (state == "COMPLETING") return "COMPLETING";
    }
  }
  return text(job, "job_state");
}

}  // namespace

Result<std::vector<SlurmJob>> read_squeue(std::string_view json) {
  const Json all = Json::parse(json, nullptr, false);
  // Without a controller squeue ends as if all were well, with an empty list.
  const auto errors = all.is_object() ? all.find("errors") : all.end();
  if (errors != all.end() && errors->is_array() && !errors->empty())
    return unavailable("squeue has no answer", errors->dump(), "is slurmctld running? see 'scontrol ping'");
  const auto rows = all.is_object() ? all.find("jobs") : all.end();
  if (!all.is_object() || rows == all.end() || !rows->is_array())
    return invalid_input("answer of squeue --json", "it is no list of jobs",
                         "Slurm 21.08 or later with its JSON plugin is needed");
  std::vector<SlurmJob> jobs;
  for (const Json& row : *rows) {
    if (!row.is_object()) continue;
    SlurmJob job;
    job.id = number(row, "array_job_id") != 0 ? number(row, "array_job_id") : number(row, "job_id");
    job.task = static_cast<int>(number(row, "array_task_id"));
    job.tasks = text(row, "array_task_string");
    job.name = text(row, "name");
    job.state = state_of(row);
    job.reason = text(row, "state_reason");
    job.description = text(row, "state_description");
    job.partition = text(row, "partition");
    job.nodes = text(row, "nodes");
    job.start_time_s = number(row, "start_time");
    job.time_limit_min = number(row, "time_limit");
    jobs.push_back(std::move(job));
  }
  return jobs;
}

namespace {

struct Explanation {
  std::string_view reason, words;
};

constexpr Explanation kExplanations[] = {
    {"Priority", "other jobs of the cluster come first"},
    {"Resources", "waits for free cores or memory"},
    {"PartitionDown", "the partition is down"},
    {"PartitionInactive", "the partition is inactive"},
    {"PartitionTimeLimit", "its time limit is longer than the partition's"},
    {"PartitionNodeLimit", "it asks for more nodes than the partition has"},
    {"ReqNodeNotAvail", "the nodes that it needs are down, drained or reserved"},
    {"JobHeldUser", "held by its user; see 'scontrol release'"},
    {"JobHeldAdmin", "held by an administrator"},
    {"launch_failed_requeued_held", "a node could not start it; see 'scontrol release'"},
    {"BeginTime", "its start time has not come, or it was put back into the queue a moment ago"},
    {"Dependency", "waits for another job"},
    {"Reservation", "waits for its reservation"},
    {"Licenses", "waits for licences"},
    {"BadConstraints", "no node is like that"},
    {"TimeLimit", "it reached its time limit"},
    {"NodeDown", "its node went down"},
    {"NonZeroExitCode", "the worker ended with an error, see its log"},
    {"AssociationJobLimit", "the account's limit of jobs is reached"},
    {"AssocGrpCpuLimit", "the account's limit of cores is reached"},
    {"AssocMaxJobsLimit", "the account's limit of jobs is reached"},
    {"QOSMaxJobsPerUserLimit", "the user's limit of jobs is reached"},
    {"QOSMaxCpuPerUserLimit", "the user's limit of cores is reached"},
    {"RaisedSignal:53(Real-time_signal_19)",
     "its node could not open the log: is the shared directory there?"},
    {"InvalidAccount", "the account is refused"},
    {"InvalidQOS", "the quality of service is refused"},
};

}  // namespace

std::string explain(const SlurmJob& job) {
  std::string words = job.description;
  for (const Explanation& known : kExplanations) {
    if (words.empty() && job.reason == known.reason) words = known.words;
  }
  if (job.reason.empty() || job.reason == "None") return words;
  return words.empty() ? job.reason : concat(job.reason, " (", words, ")");
}

}  // namespace flamefield
