#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "reconstruct/ranks.h"

namespace flamefield {

// OUT.run.json beside the volume: which ranks work on it, where they are, and how it ended. Written whole or
// not at all. When the launcher ends the run because a rank has died, whoever is left writes that and ends
// too: nobody comes back from waiting for the dead.
class RanksRecord {
 public:
  // `stop`: requested by SIGTERM, which the launcher sends when a rank has died.
  RanksRecord(Ranks& ranks, const std::filesystem::path& volume, std::string command_line,
              std::stop_token stop);
  ~RanksRecord();  // unless ended: "failed"
  RanksRecord(const RanksRecord&) = delete;

  void at(int iteration) { iteration_ = iteration; }
  void end(const std::string& state, const std::string& problem = {});

 private:
  struct Peer {
    std::string host;
    int pid = 0;
  };
  std::optional<std::size_t> dead_peer() const;  // among those on this machine
  void write(const std::string& state, const std::string& problem) const;
  void check_peers() const;

  Ranks& ranks_;
  std::filesystem::path path_;
  std::string command_line_, started_;
  std::vector<Peer> peers_;
  std::atomic<int> iteration_ = 0;
  bool ended_ = false;
  std::optional<std::stop_callback<std::function<void()>>> on_stop_;
};

}  // namespace flamefield
