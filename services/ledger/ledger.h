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
  Result<> put_live_plan(const LivePlan& plan);
  Result<LivePlan> live_plan();

  // --- jobs
  // Gives the job its number; none when identical work is done, running or waiting. NotFound: unknown rig or
  // set.
  Result<std::optional<std::int64_t>> add_job(const Job& job);
  // The next job in line, now leased to `worker` under a new token; none when nothing is due.
  Result<std::optional<Lease>> lease_next(const std::string& worker, std::int64_t now_ns,
                                          std::int64_t duration_ms);
  enum class Commit { Done, AlreadyDone, Stale };
  Result<Commit> finish(std::int64_t token, const Run& run, std::int64_t now_ns);
  // False: the token is stale. `retry_at_ns`: when to try again; none: the job has failed for good.
  Result<bool> fail(std::int64_t token, const std::string& reason, std::optional<std::int64_t> retry_at_ns);
  Result<std::optional<std::int64_t>> job_of_token(std::int64_t token);  // while the lease is valid
  Result<int> attempt_of_token(std::int64_t token);
  // After a restart no lease is valid any more; the lost attempts do not count. Returns how many there were.
  Result<std::int64_t> void_all_leases();
  Result<std::optional<std::int64_t>> next_due_ns();  // earliest not_before of a queued job

  Result<> put_metrics(const PutMetrics& metrics);  // NotFound: no such run
  Result<> add_event(const Event& event);
  Result<Status> status(std::int64_t now_ns);  // everything but the workers

 private:
  struct Impl;
  explicit Ledger(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

std::filesystem::path ledger_path(const std::filesystem::path& directory);

}  // namespace flamefield
