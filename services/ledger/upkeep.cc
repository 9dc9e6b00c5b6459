// The writer's part in upkeep: tags, calibrations, schedules, artefacts and their retirement.
#include "services/ledger/writer.h"

namespace flamefield {

void Ledger::Impl::add_artefacts(const Run& run) {
  constexpr const char* kAdd =
      "INSERT OR REPLACE INTO artefacts(path, run_id, kind, bytes, sha256, retired_time_ns) "
      "VALUES(?1, ?2, ?3, ?4, ?5, 0)";
  sql.run(kAdd, run.volume_path, run.id, "volume", run.volume_bytes, run.volume_sha256);
  if (!run.projections_path.empty())
    sql.run(kAdd, run.projections_path, run.id, "projections", run.projections_bytes, run.projections_sha256);
}

std::optional<std::int64_t> Ledger::Impl::revive(const Job& job) {
  const auto id = integer(
      "SELECT id FROM jobs WHERE run_id = ?1 AND state = 'done' AND EXISTS(SELECT 1 FROM artefacts a WHERE "
      "a.run_id = ?1 AND retired_time_ns > 0)",
      job.run_id);
  if (!id) return std::nullopt;
  sql.run(
      "UPDATE jobs SET state = 'queued', attempt = 0, not_before_ns = 0, reason = '', worker = '', crashes = "
      "0, "
      "tied_to = '', paused = 0, created_time_ns = ?2, priority = ?3, record = ?4, submitter = ?5, "
      "submission = ?6, share = ?7 WHERE id = ?1",
      *id, job.created_time_ns, static_cast<int>(job.priority), Blob{encode(Lease{0, 0, job, {}})},
      job.submitter, job.submission, share_of(job));
  return id;
}

Result<> Ledger::put_tags(const PutTags& tags) {
  return guarded(impl_->database, [&]() -> Result<> {
    if (!impl_->integer("SELECT 1 FROM runs WHERE id = ?1 UNION SELECT 1 FROM captures WHERE id = ?1",
                        tags.subject))
      return not_found(concat("run or capture ", tags.subject), "it is not in the ledger",
                       "see 'flamefield runs list'");
    for (const std::string& tag : tags.add)
      impl_->sql.run("INSERT INTO tags(subject, tag) VALUES(?1, ?2) ON CONFLICT DO NOTHING", tags.subject,
                     tag);
    for (const std::string& tag : tags.remove)
      impl_->sql.run("DELETE FROM tags WHERE subject = ?1 AND tag = ?2", tags.subject, tag);
    return {};
  });
}

Result<> Ledger::accept_rig(const AcceptRig& accepted, std::int64_t now_ns) {
  return guarded(impl_->database, [&]() -> Result<> {
    if (!impl_->integer("SELECT 1 FROM rigs WHERE id = ?1", accepted.rig_id))
      return not_found(concat("rig ", accepted.rig_id), "it is not in the ledger", "store it first");
    impl_->sql.run("INSERT INTO accepted_rigs(rig_id, accepted_time_ns, since_ns) VALUES(?1, ?2, ?3)",
                   accepted.rig_id, now_ns, accepted.since_ns);
    return {};
  });
}

Result<> Ledger::put_schedule(const Schedule& schedule) {
  return guarded(impl_->database, [&]() -> Result<> {
    impl_->sql.run(
        "INSERT INTO schedules(name, cron, zone, created_time_ns, last_due_ns, record) VALUES(?1, ?2, ?3, "
        "?4, ?5, ?6) ON CONFLICT(name) DO UPDATE SET cron = ?2, zone = ?3, created_time_ns = ?4, "
        "last_due_ns = ?5, record = ?6",
        schedule.name, schedule.cron, schedule.zone, schedule.created_time_ns, schedule.last_due_ns,
        Blob{encode(PutSchedule{schedule})});
    return {};
  });
}

Result<> Ledger::drop_schedule(const std::string& name) {
  return guarded(impl_->database, [&]() -> Result<> {
    impl_->sql.run("DELETE FROM schedule_jobs WHERE schedule = ?1", name);
    if (impl_->sql.run("DELETE FROM schedules WHERE name = ?1", name) == 0)
      return not_found(concat("schedule ", name), "it is not in the ledger",
                       "see 'flamefield schedule list'");
    return {};
  });
}

Result<> Ledger::schedule_ran(const ScheduleRan& happened) {
  return guarded(impl_->database, [&]() -> Result<> {
    if (impl_->sql.run("UPDATE schedules SET last_due_ns = max(last_due_ns, ?2) WHERE name = ?1",
                       happened.name, happened.due_ns) == 0)
      return not_found(concat("schedule ", happened.name), "it is not in the ledger", "it was dropped");
    impl_->sql.run(
        "INSERT INTO schedule_runs(schedule, due_ns, time_ns, outcome, text, jobs) VALUES(?1, ?2, ?3, ?4, "
        "?5, ?6)",
        happened.name, happened.due_ns, happened.time_ns, happened.outcome, happened.text,
        happened.job_ids.size());
    for (std::int64_t job : happened.job_ids)
      impl_->sql.run("INSERT INTO schedule_jobs(schedule, job_id) VALUES(?1, ?2) ON CONFLICT DO NOTHING",
                     happened.name, job);
    return {};
  });
}

Result<std::vector<std::string>> Ledger::retire(const Retire& retire, std::int64_t now_ns) {
  return guarded(impl_->database, [&]() -> Result<std::vector<std::string>> {
    std::vector<std::string> files;
    for (const std::string& run : retire.run_ids) {
      const auto job = impl_->integer(
          "SELECT j.id FROM runs r JOIN jobs j ON j.id = r.job_id JOIN rigs g ON g.id = r.rig_id JOIN "
          "recipes p ON p.id = j.recipe_id WHERE r.id = ?1 AND j.state = 'done'",
          run);
      const bool has_inputs =
          job && impl_->integer("SELECT count(*) FROM job_inputs WHERE job_id = ?1", *job).value_or(0) > 0;
      if (!has_inputs)
        return invalid_input(concat("run ", run), "it is not done, or could not be made again",
                             "keep its files");
      auto& row = impl_->sql("SELECT path FROM artefacts WHERE run_id = ?1 AND retired_time_ns = 0", run);
      while (row.executeStep()) files.push_back(row.getColumn(0).getString());
      row.reset();
    }
    for (const std::string& file : files)
      impl_->sql.run("UPDATE artefacts SET retired_time_ns = ?2 WHERE path = ?1", file, now_ns);
    return files;
  });
}

Result<std::vector<std::string>> Ledger::retired_files() {
  return guarded(impl_->database, [&]() -> Result<std::vector<std::string>> {
    std::vector<std::string> files;
    auto& row = impl_->sql("SELECT path FROM artefacts WHERE retired_time_ns > 0");
    while (row.executeStep()) files.push_back(row.getColumn(0).getString());
    row.reset();
    return files;
  });
}

}  // namespace flamefield
