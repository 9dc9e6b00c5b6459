#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "services/cli/connection.h"
#include "services/cluster/cluster.h"

namespace flamefield {

// --config, --endpoint, --pilots ...: lab.toml's [cluster], and what the command line says instead.
struct ClusterOptions {
  std::filesystem::path config;
  std::string endpoint;
  std::optional<int> pilots, cores, memory_mib, minutes;

  // `data`: where its --data was given, that folder counts, and else the one of lab.toml, which it is set to.
  ClusterPlace place(DataOption& data, bool data_given) const;
  PilotSize size(const PilotWork& work, const ClusterConfig& config) const;
};
void add_cluster_place(CLI::App& command, ClusterOptions& options);
void add_cluster_size(CLI::App& command, ClusterOptions& options);

// Clears up after pilots of earlier, and submits; says on stderr what is amiss. `connected`: of the
// dispatcher's status.
Hired hire_pilots(const ClusterPlace& place, const PilotSize& size, bool live,
                  const std::vector<Status::Worker>& connected);
std::string text_of(const Hired& hired, const PilotSize& size);

}  // namespace flamefield
