#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "proto/job.h"
#include "proto/message.h"
#include "services/spool/spool.h"

namespace flamefield {

// A job that waits for its turn.
struct QueuedJob {
  std::int64_t id = 0;
  Priority priority = Priority::Interactive;
  std::string share = {};          // whose share of the workers it uses
  std::int64_t not_before_ns = 0;  // back-off
  bool paused = false;
  std::string tied_to = {};  // the worker that died of it
  std::string setup = {};    // equal when rig, recipe and grid are
  std::string solver = {};
  double work = 0;  // voxels x views
};

// A job that somebody works on.
struct HeldJob {
  std::int64_t id = 0;
  std::string run_id, worker;
  int attempt = 0, crashes = 0;
};

struct LeaseTerms {
  std::string worker;
  bool in_process = false;  // a thread of the dispatcher's process
  std::int64_t now_ns = 0, duration_ms = 0;
};

struct Failure {
  std::string reason;
  std::optional<std::int64_t> retry_at_ns = {};  // none: for good
  bool crashed = false;                          // the worker died of it
  bool counts = true;                            // as an attempt
};

struct ControlledJob {
  std::int64_t id = 0;
  std::int64_t token = 0;  // of its last lease
};

// What a run took.
struct RunCost {
  std::string setup, solver;
  double work = 0, wall_s = 0, peak_rss_mib = 0;
};

std::string setup_of(const Processing& processing);  // as in QueuedJob
std::string share_of(const Job& job);

// The book of everything that happened: one SQLite file (WAL, synchronous=FULL) with exactly one writer, held
// by a lock file beside it. Times are UTC ns, given by the caller. All methods: Unavailable when the disk
// refuses, DataLoss when the file is damaged.
class Ledger {
 public:
  // Makes or migrates `directory`/ledger.sqlite. Unavailable: locked by another process (named).
  // InvalidInput: written by a newer program.
  static Result<Ledger> open(const std::filesystem::path& directory);
  Ledger(Ledger&&) noexcept;
  ~Ledger();

  // What happens between begin() and commit() happens together or, without commit(), not at all.
  class Transaction {
   public:
    Transaction(Transaction&&) noexcept;
    ~Transaction();
    Result<> commit();

   private:
    friend class Ledger;
    struct Impl;
    explicit Transaction(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
  };
  Result<Transaction> begin();
  Result<Transaction> begin_within();  // another one; Unavailable when that was rolled back

  // --- captures and sets
  Result<> put_capture(const PutCapture& capture);
  // False: a set of this capture and index is there already; nothing changes.
  Result<bool> add_set(const FrameSet& set, const SpoolLocation& location, std::int64_t now_ns);
  Result<bool> has_set(const SetId& id);
  Result<SpoolLocation> location_of(const SetId& id);  // NotFound
  Result<std::vector<SetId>> sets_of(const std::string& capture);
  Result<SpoolLocation> last_location();  // of the set furthest in the spool; {} when there is none

  // --- rigs, plan
  Result<std::string> put_rig(const Rig& rig, std::int64_t now_ns);  // its fingerprint
  Result<Rig> rig(const std::string& rig_id);                        // NotFound
  // Gives the calibration its version, the one before, rig and time. Nothing is ever overwritten.
  Result<CalibrationStored> put_calibration(const PutCalibration& accepted, std::int64_t now_ns);
  Result<> put_live_plan(const LivePlan& plan);
  Result<LivePlan> live_plan();

  // --- jobs (ledger_jobs.cc)
  // Gives the job its number; none when identical work is done, running or waiting. NotFound: unknown rig or
  // set.
  Result<std::optional<std::int64_t>> add_job(const Job& job, double work);
  Result<std::int64_t> next_submission();
  Result<std::vector<QueuedJob>> queued_jobs();
  Result<std::optional<QueuedJob>> queued_job(std::int64_t id);  // none: not waiting
  // Leases a waiting job under a new token; none when it is not waiting (any more).
  Result<std::optional<Lease>> lease(std::int64_t job_id, const LeaseTerms& terms);
  Result<std::optional<HeldJob>> held(std::int64_t token);  // while the lease is valid
  enum class Commit { Done, AlreadyDone, Stale };
  Result<Commit> finish(std::int64_t token, const Run& run, std::int64_t now_ns);
  Result<bool> fail(std::int64_t token, const Failure& failure);  // false: the token is stale
  // No lease is valid any more; the lost attempts do not count. When that is because the program was started
  // again, jobs of threads of its process may have killed it: the third time they fail. Returns how many
  // leases there were.
  Result<std::int64_t> void_all_leases(bool restarted);

  // --- control of jobs (ledger_control.cc)
  Result<std::vector<ControlledJob>> control(const ControlJobs& what);  // those that changed
  Result<> pause_all(bool paused);
  Result<bool> paused_all();
  Result<std::vector<Jobs::Row>> jobs(const GetJobs& asked);  // in the order of their numbers
  Result<std::string> reason_of(std::int64_t job_id);         // of its last failure
  Result<std::vector<RunCost>> costs(std::int64_t limit);     // of the newest runs, oldest first

  Result<> put_metrics(const PutMetrics& metrics);  // NotFound: no such run
  Result<> add_event(const Event& event);

  // --- upkeep
  Result<> put_tags(const PutTags& tags);                               // NotFound: no such run or capture
  Result<> accept_rig(const AcceptRig& accepted, std::int64_t now_ns);  // NotFound: the rig was not stored
  Result<> put_schedule(const Schedule& schedule);
  Result<> drop_schedule(const std::string& name);     // NotFound
  Result<> schedule_ran(const ScheduleRan& happened);  // NotFound
  // Marks the runs' files as removed, and lets their work be asked for again. Returns the files, relative to
  // the directory. InvalidInput, and nothing changes, when a run could not be made again.
  Result<std::vector<std::string>> retire(const Retire& retire, std::int64_t now_ns);
  Result<std::vector<std::string>> retired_files();

  Result<Status> status();  // the numbers; not the workers, nor who waits for what

 private:
  struct Impl;
  explicit Ledger(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

std::filesystem::path ledger_path(const std::filesystem::path& directory);

}  // namespace flamefield
