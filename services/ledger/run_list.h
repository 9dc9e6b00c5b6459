#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "proto/error.h"

namespace flamefield {

struct ReadOnlyLedger;

// What a table of runs shows of one, without its whole record.
struct RunLine {
  std::string id, capture, solver, worker, rig_id;
  std::int64_t first_index = 0, inputs = 1, iterations = 0, volume_bytes = 0;
  double residual = 0;
  std::int64_t started_time_ns = 0, finished_time_ns = 0;
};

enum class RunOrder { Finished, Capture, Solver, Residual, Duration, Size };

// All conditions must hold; empty ones always do.
struct RunQuery {
  std::string search = {};  // part of the id or of the worker's name
  std::string capture = {}, solver = {}, rig_id = {};
  RunOrder order = RunOrder::Finished;
  bool is_descending = true;
  std::int64_t offset = 0, limit = 100;
};

// The jobs with ids from first to last.
struct JobPage {
  std::int64_t queued = 0, leased = 0, done = 0, failed = 0;
  struct Line {
    std::int64_t id = 0;
    std::string run_id, state, worker, reason;
    int attempt = 0;
  };
  std::vector<Line> lines;  // newest first, when it was cut
};

struct RunPage {
  std::int64_t total = 0;  // that meet the conditions
  std::vector<RunLine> lines;
};

// Pages through the runs of a ledger, of which there may be a hundred thousand: read from one index that
// holds all that the table shows. One thread.
class RunList {
 public:
  // NotFound when there is no ledger yet; InvalidInput when it is of another version.
  static Result<RunList> open(const std::filesystem::path& directory);
  RunList(RunList&&) noexcept;
  ~RunList();

  Result<RunPage> page(const RunQuery& query);
  Result<std::vector<std::string>> solvers();

  Result<JobPage> jobs(std::int64_t first, std::int64_t last, std::int64_t limit);

  // Of one stored set; 0: there is none.
  Result<std::int64_t> pulse_time_ns(const std::string& capture, std::int64_t index);

 private:
  explicit RunList(std::unique_ptr<ReadOnlyLedger> ledger);
  std::unique_ptr<ReadOnlyLedger> ledger_;
};

}  // namespace flamefield
