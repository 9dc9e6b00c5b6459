// Messages about the line of waiting jobs.
#include "proto/codec/wire.h"

namespace flamefield {

namespace {

void read_state(const std::string& text, JobState& state, Check& check) {
  read_enum(text, job_state_from_name(text), state, "job state", check);
}

}  // namespace

void write(const ControlJobs& m, v1::ControlJobs* wire) {
  wire->set_action(std::string(name_of(m.action)));
  for (const std::int64_t id : m.jobs) wire->add_jobs(id);
  wire->set_submission(m.submission);
  wire->set_all(m.all);
}
void read(const v1::ControlJobs& wire, ControlJobs& m, Check& check) {
  read_enum(wire.action(),
            one_of(wire.action(), {JobAction::Pause, JobAction::Resume, JobAction::Cancel, JobAction::Retry}),
            m.action, "action", check);
  m.jobs.assign(wire.jobs().begin(), wire.jobs().end());
  m.submission = wire.submission();
  m.all = wire.all();
}

void write(const JobsControlled& m, v1::JobsControlled* wire) {
  wire->set_changed(m.changed);
  wire->set_unchanged(m.unchanged);
}
void read(const v1::JobsControlled& wire, JobsControlled& m, Check&) {
  m.changed = wire.changed();
  m.unchanged = wire.unchanged();
}

void write(const GetJobs& m, v1::GetJobs* wire) {
  if (m.state) wire->set_state(std::string(name_of(*m.state)));
  wire->set_submission(m.submission);
  wire->set_limit(m.limit);
}
void read(const v1::GetJobs& wire, GetJobs& m, Check& check) {
  if (!wire.state().empty()) read_state(wire.state(), m.state.emplace(), check);
  m.submission = wire.submission();
  m.limit = wire.limit();
  check.count(m.limit, "limit");
}

void write(const Jobs& m, v1::Jobs* wire) {
  for (const Jobs::Row& row : m.rows) {
    auto* out = wire->add_rows();
    out->set_id(row.id);
    out->set_run_id(row.run_id);
    out->set_state(std::string(name_of(row.state)));
    out->set_priority(std::string(name_of(row.priority)));
    out->set_submitter(row.submitter);
    out->set_submission(row.submission);
    out->set_attempt(row.attempt);
    out->set_worker(row.worker);
    out->set_created_time_ns(row.created_time_ns);
    out->set_why(row.why);
  }
}
void read(const v1::Jobs& wire, Jobs& m, Check& check) {
  for (const auto& row : wire.rows()) {
    Jobs::Row out{
        row.id(),     row.run_id(),          {},       {}, row.submitter(), row.submission(), row.attempt(),
        row.worker(), row.created_time_ns(), row.why()};
    read_state(row.state(), out.state, check);
    read_priority(row.priority(), out.priority, check);
    m.rows.push_back(std::move(out));
  }
}

}  // namespace flamefield
