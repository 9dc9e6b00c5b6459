#include "services/cli/cluster_options.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <iostream>

#include "services/cli/app.h"

namespace flamefield {

ClusterPlace ClusterOptions::place(DataOption& data, bool data_given) const {
  LabConfig lab = config.empty() ? LabConfig{} : or_usage(read_lab_config(config));
  if (data_given || config.empty())
    lab.data_directory = data.dir;
  else
    data.dir = lab.data_directory;
  if (!endpoint.empty()) lab.cluster.endpoint = endpoint;
  return or_usage(cluster_place(lab));
}

PilotSize ClusterOptions::size(const PilotWork& work, const ClusterConfig& cluster) const {
  ClusterConfig changed = cluster;
  changed.pilots = pilots.value_or(cluster.pilots);
  changed.cores = cores.value_or(cluster.cores);
  changed.memory_mib = memory_mib.value_or(cluster.memory_mib);
  changed.minutes = minutes.value_or(cluster.minutes);
  PilotWork all = work;
  if (pilots) {  // whoever names a number wants it
    all.volumes = std::max<std::int64_t>(all.volumes, *pilots);
    all.seconds = std::max(all.seconds, 0.0);
  }
  PilotSize asked = size_pilots(all, changed);
  if (pilots) asked.pilots = *pilots;
  return asked;
}

void add_cluster_place(CLI::App& command, ClusterOptions& options) {
  command.add_option("--config", options.config, "lab.toml with [cluster]");
  command.add_option(
      "--endpoint", options.endpoint,
      "Of the dispatcher, as the nodes see it, in place of lab.toml's, e.g. tcp://10.0.0.1:7300");
}

void add_cluster_size(CLI::App& command, ClusterOptions& options) {
  command
      .add_option("--pilots", options.pilots,
                  "So many (default: as the work needs, [cluster] pilots at most)")
      ->check(CLI::Range(1, 20'000));
  command.add_option("--cores", options.cores, "Of each pilot")->check(CLI::Range(1, 4096));
  command
      .add_option("--memory-mib", options.memory_mib,
                  "Of each pilot (default: a quarter more than runs took)")
      ->check(CLI::Range(1, 100'000'000));
  command.add_option("--minutes", options.minutes, "Time limit of a pilot (default: from the estimate)")
      ->check(CLI::Range(1, 100'000));
}

Hired hire_pilots(const ClusterPlace& place, const PilotSize& size, bool live,
                  const std::vector<Status::Worker>& connected) {
  clear_up(place, connected);
  const std::string& partition = live ? place.config.live_partition : place.config.partition;
  // A controller that is away is no reason to give up: the submission tries for a while.
  const auto state = partition_state(partition);
  if (!state && state.error().code != ErrorCode::Unavailable) or_usage(state);
  if (state && !state->empty() && *state != "up")
    std::cerr << "flamefield: partition '" << partition << "' is " << *state
              << " (pilots wait until it is up) see 'flamefield cluster status'\n";
  return or_usage(hire(place, size, live));
}

std::string text_of(const Hired& hired, const PilotSize& size) {
  std::string text =
      fmt::format("{}: {} pilot{} of {} core{} and {} MiB{}, Slurm calls it {}", hired.name, size.pilots,
                  size.pilots == 1 ? "" : "s", size.cores, size.cores == 1 ? "" : "s", size.memory_mib,
                  hired.live ? "" : fmt::format(" for {} min", size.minutes),
                  hired.pilots.empty() ? 0 : hired.pilots.front().id);
  if (!hired.live && size.seconds_left > 0)
    text += fmt::format("\nabout {:.1f} h of the work will not fit: run 'flamefield cluster up' again then",
                        size.seconds_left / 3600);
  return text;
}

}  // namespace flamefield
