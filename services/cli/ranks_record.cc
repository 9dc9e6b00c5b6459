#include "services/cli/ranks_record.h"

#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <iostream>
#include <nlohmann/json.hpp>

#include "proto/utc.h"
#include "proto/version.h"
#include "services/cli/app.h"
#include "services/cli/together.h"
#include "services/store/file.h"
#include "services/worker/machine.h"

namespace flamefield {

RanksRecord::RanksRecord(Ranks& ranks, const std::filesystem::path& volume, std::string command_line,
                         std::stop_token stop)
    : ranks_(ranks),
      path_(volume.string() + ".run.json"),
      command_line_(std::move(command_line)),
      started_(utc_text(utc_now_ns())) {
  for (const std::string& peer : gather_texts(ranks, concat(::getpid(), ' ', host_name()))) {
    const std::size_t space = peer.find(' ');
    peers_.push_back({peer.substr(space + 1), std::stoi(peer.substr(0, space))});
  }
  if (ranks_.rank() == 0) write("running", {});
  on_stop_.emplace(std::move(stop), [this] { check_peers(); });
}

RanksRecord::~RanksRecord() {
  on_stop_.reset();
  if (!ended_ && ranks_.rank() == 0) write("failed", "the work ended early; its message is on stderr");
}

void RanksRecord::end(const std::string& state, const std::string& problem) {
  ended_ = true;
  if (ranks_.rank() == 0) write(state, problem);
}

std::optional<std::size_t> RanksRecord::dead_peer() const {
  const std::string here = host_name();
  for (std::size_t r = 0; r < peers_.size(); ++r)
    if (peers_[r].host == here && ::kill(peers_[r].pid, 0) != 0 && errno == ESRCH) return r;
  return std::nullopt;
}

// Runs in the thread that got the signal: this rank's own may wait for the dead one.
void RanksRecord::check_peers() const {
  const auto dead = dead_peer();
  if (!dead) return;  // a stop by request
  const std::string problem = concat("rank ", *dead, " (pid ", peers_[*dead].pid, " on ", peers_[*dead].host,
                                     ") died in iteration ", iteration_ + 1);
  write("failed", problem);
  std::cerr << concat("flamefield: ", problem,
                      " (the others cannot go on without its part of the volume) see ", path_.string(),
                      " and start again\n");
  ::_Exit(static_cast<int>(ExitCode::Failed));
}

void RanksRecord::write(const std::string& state, const std::string& problem) const {
  nlohmann::ordered_json ranks = nlohmann::ordered_json::array();
  for (std::size_t r = 0; r < peers_.size(); ++r)
    ranks.push_back({{"rank", r}, {"host", peers_[r].host}, {"pid", peers_[r].pid}});
  const nlohmann::ordered_json record = {{"state", state},
                                         {"problem", problem},
                                         {"command", command_line_},
                                         {"program", program_version()},
                                         {"started", started_},
                                         {"written", utc_text(utc_now_ns())},
                                         {"written_by_rank", ranks_.rank()},
                                         {"iterations", iteration_.load()},
                                         {"ranks", ranks}};
  // Nobody could be told that it failed.
  (void)write_text_file(path_, record.dump(2) + "\n");
}

}  // namespace flamefield
