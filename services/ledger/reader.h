#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "proto/job.h"
#include "proto/message.h"

namespace flamefield {

struct ReadOnlyLedger;

struct CaptureRow {
  PutCapture capture;
  std::int64_t sets = 0;    // stored
  std::int64_t frames = 0;  // stored
  std::int64_t losses = 0;  // frames lost, with a name
};

struct SetRow {
  SetId id;
  std::int64_t pulse = 0;
  std::int64_t pulse_time_ns = 0, complete_time_ns = 0, stored_time_ns = 0;
  std::int64_t frames = 0, losses = 0;
};

struct RunRow {
  Run run;  // metrics include what was added later
  std::int64_t committed_time_ns = 0;
};

struct JobRow {
  std::int64_t id = 0;
  std::string run_id;
  JobState state = JobState::Queued;
  int attempt = 0;
  std::string worker, reason;
};

// All conditions must hold; empty ones always do.
struct RunFilter {
  std::string capture = {};
  std::string rig_id = {};
  std::string solver = {};
  std::int64_t since_ns = 0;                // finished at or after
  std::optional<std::int64_t> inputs = {};  // number of sets that went in: 1 leaves the means out
  std::int64_t limit = 1000;                // newest first when it cuts
};

// What became of a capture. Holds: pulses = frames + losses per camera; sets = volumes + failed + pending +
// not_asked, counting jobs of one set each.
struct Receipt {
  struct CameraLine {
    std::string camera;
    std::int64_t pulses = 0;  // in which it had to deliver
    std::int64_t frames = 0;
    std::map<std::string, std::int64_t> losses;  // by cause; of an interrupted capture also: not-stored
    // What else the array counted, e.g. late, duplicate, extra, count-slip: see CameraAccount.
    std::map<std::string, std::int64_t> counters = {};
    bool balances() const;
  };
  struct Failure {
    std::string run_id;
    std::string reason;
  };
  PutCapture capture;
  std::vector<CameraLine> cameras;
  std::int64_t sets = 0;
  std::int64_t sets_not_stored = 0;  // seen, but the capture was interrupted before they were durable
  std::int64_t volumes = 0, failed = 0, pending = 0, not_asked = 0;  // sets
  std::int64_t combined_volumes = 0;                                 // runs of several sets
  std::vector<Failure> failures;
  bool balances() const;
};

// Looks into a ledger that another process or thread may be writing. Any number of readers; one thread each.
class LedgerReader {
 public:
  // NotFound when there is no ledger yet; InvalidInput when it is of another version.
  static Result<LedgerReader> open(const std::filesystem::path& directory);
  LedgerReader(LedgerReader&&) noexcept;
  ~LedgerReader();

  Result<std::vector<CaptureRow>> captures();
  Result<std::vector<SetRow>> sets(const std::string& capture);
  Result<std::vector<RunRow>> runs(const RunFilter& filter = {});  // by capture, then first set
  Result<RunRow> run(const std::string& run_id);                   // NotFound
  Result<Receipt> receipt(const std::string& capture);             // NotFound
  Result<std::vector<JobRow>> jobs(std::optional<JobState> state = {});
  Result<Rig> rig(const std::string& rig_id);  // NotFound
  // That were accepted, the first one first; and one of them with its rig as it was found (NotFound).
  Result<std::vector<Calibration>> calibrations();
  Result<PutCalibration> calibration(std::int64_t version);
  Result<std::vector<Event>> events(std::int64_t limit = 100);  // newest first

 private:
  explicit LedgerReader(std::unique_ptr<ReadOnlyLedger> ledger);
  std::unique_ptr<ReadOnlyLedger> ledger_;
};

}  // namespace flamefield
