#pragma once

#include "proto/version.h"
#include "services/ledger/ledger.h"
#include "services/ledger/query.h"
#include "tests/services/support.h"

// A ledger filled by hand, without a dispatcher.
namespace flamefield::testing_support {

inline constexpr std::int64_t kFirstPulse_ns = 1'700'000'000'000'000'000;  // of make_set
inline constexpr std::int64_t kNow_ns = kFirstPulse_ns + 3'600'000'000'000;

class FilledLedger {
 public:
  explicit FilledLedger(int sets) : ledger_(Ledger::open(scratch_.path()).value()) {
    EXPECT_TRUE(ledger_.put_rig(make_rig(), kNow_ns));
    for (int i = 0; i < sets; ++i)
      EXPECT_TRUE(
          *ledger_.add_set(make_set("burst", i), {1, static_cast<std::uint64_t>(i) * 100, 100}, kNow_ns));
  }

  Job job(std::vector<SetId> inputs, const Processing& processing = make_processing()) const {
    Job job;
    job.inputs = std::move(inputs);
    job.processing = processing;
    job.program_version = program_version();
    job.run_id = run_id_of(job);
    job.created_time_ns = kNow_ns;
    return job;
  }
  // Asked for and done at once.
  std::string add_run(std::vector<SetId> inputs, const Processing& processing = make_processing(),
                      double residual = 0.25, std::int64_t committed_ns = kNow_ns) {
    const Job asked = job(std::move(inputs), processing);
    const auto id = ledger_.add_job(asked, 0);
    EXPECT_TRUE(id->has_value());
    const Lease lease = lease_of(**id);
    EXPECT_EQ(lease.job.run_id, asked.run_id);
    flamefield::Run run;
    run.id = asked.run_id;
    run.job_id = lease.job.id;
    run.inputs = asked.inputs;
    run.processing = asked.processing;
    run.program_version = asked.program_version;
    run.volume_path = "volumes/" + run.id + ".vtkhdf";
    run.volume_sha256 = std::string(64, '0');
    run.volume_bytes = 10;
    run.solver = processing.recipe.solver;
    run.residual = residual;
    run.metrics = {{"pearson_3d", 1 - residual}};
    run.timings.solve_s = 2;
    run.peak_rss_mib = 100;
    run.finished_time_ns = committed_ns;
    EXPECT_EQ(*ledger_.finish(lease.token, run, committed_ns), Ledger::Commit::Done);
    return run.id;
  }

  Lease lease_of(std::int64_t job) {
    return ledger_.lease(job, {.worker = "w", .now_ns = kNow_ns, .duration_ms = 1000})->value();
  }

  Ledger& writer() { return ledger_; }
  LedgerQuery query() const { return LedgerQuery::open(scratch_.path()).value(); }
  const std::filesystem::path& path() const { return scratch_.path(); }
  // The runs that a filter finds, newest first.
  std::vector<std::string> find(const std::string& where) const {
    const auto filter = parse_filter(where, kNow_ns);
    EXPECT_TRUE(filter) << filter.error().message;
    const auto rows = query().work(*filter, 1000);
    EXPECT_TRUE(rows) << where << ": " << rows.error().message;
    EXPECT_EQ(*query().count_work(*filter), static_cast<std::int64_t>(rows->size())) << where;
    std::vector<std::string> ids;
    for (const WorkRow& row : *rows) ids.push_back(row.run.id);
    return ids;
  }

 private:
  Scratch scratch_;
  Ledger ledger_;
};

}  // namespace flamefield::testing_support
