#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <stop_token>
#include <string>

#include "proto/error.h"

namespace flamefield {

struct QueueOptions {
  std::int64_t jobs = 10'000;      // of one order
  std::int64_t runs = 100'000;     // in the ledger when it is asked; 0: not measured
  int workers = 8;                 // that do nothing, as fast as they can
  std::filesystem::path data_dir;  // an empty folder on the disk that is to be measured
};

struct QueueMeasurement {
  double submit_s = 0;                   // from the order to its answer
  double done_s = 0;                     // until the last job is committed
  double job_wall_ms = 0;                // of that, each job: what the dispatcher and its disk add to a job
  double job_cpu_ms = 0;                 // likewise, time of the dispatcher's thread
  double restart_s = 0;                  // of a dispatcher with a full queue
  std::map<std::string, double> ask_ms;  // questions to a ledger of `runs` runs, each at its slowest of five
};

// An order of many jobs through a real dispatcher, with workers whose work takes no time; and the questions
// that people ask a large ledger.
Result<QueueMeasurement> measure_queue(const QueueOptions& options, std::stop_token stop,
                                       const std::function<void(const std::string&)>& progress);

}  // namespace flamefield
