// Messages about what is kept: sets, captures, rigs, plans, status.
#include "proto/codec/wire.h"

namespace flamefield {

void write(const PutSet& m, v1::PutSet* wire) {
  write(m.set, wire->mutable_set());
}
void read(const v1::PutSet& wire, PutSet& m, Check& check) {
  read(wire.set(), m.set, check);
}

void write(const SetStored& m, v1::SetStored* wire) {
  write(m.id, wire->mutable_id());
  wire->set_already_there(m.already_there);
}
void read(const v1::SetStored& wire, SetStored& m, Check& check) {
  read(wire.id(), m.id, check);
  m.already_there = wire.already_there();
}

void write(const PutCapture& m, v1::PutCapture* wire) {
  wire->set_id(m.id);
  wire->set_kind(std::string(name_of(m.kind)));
  wire->set_started_time_ns(m.started_time_ns);
  wire->set_finished_time_ns(m.finished_time_ns);
  wire->set_pulses(m.pulses);
  write_all(m.cameras, wire->mutable_cameras());
  wire->set_pulses_wanted(m.pulses_wanted);
  wire->set_pre_pulses(m.pre_pulses);
  wire->set_end(std::string(name_of(m.end)));
  wire->set_end_reason(m.end_reason);
  write_all(m.accounts, wire->mutable_accounts());
  for (const auto& [name, value] : m.settings) (*wire->mutable_settings())[name] = value;
}
void read(const v1::PutCapture& wire, PutCapture& m, Check& check) {
  m = {wire.id(), CaptureKind::Burst, wire.started_time_ns(), wire.finished_time_ns(), wire.pulses()};
  m.pulses_wanted = wire.pulses_wanted();
  m.pre_pulses = wire.pre_pulses();
  m.end_reason = wire.end_reason();
  check.name(m.id, "capture");
  check.count(m.pulses, "pulses");
  check.count(m.pulses_wanted, "pulses_wanted");
  check.count(m.pre_pulses, "pre_pulses");
  check.require(wire.cameras_size() <= kMaxCameras && wire.accounts_size() <= kMaxCameras, "capture",
                "more than 256 cameras");
  if (!check.problem().empty()) return;
  if (!wire.end().empty())
    read_enum(wire.end(), capture_end_from_name(wire.end()), m.end, "end of the capture", check);
  read_all(wire.accounts(), m.accounts, check);
  check.require(wire.settings_size() <= 200, "capture", "more than 200 settings");
  for (const auto& [name, value] : wire.settings()) {
    check.name(name, "setting");
    check.require(value.size() <= 200 && value.find('\n') == std::string::npos, "setting",
                  "not one short line");
    m.settings[name] = value;
  }
  read_enum(wire.kind(), capture_kind_from_name(wire.kind()), m.kind, "capture kind", check);
  for (const std::string& camera : wire.cameras()) {
    check.name(camera, "camera");
    m.cameras.push_back(camera);
  }
}

void write(const PutRig& m, v1::PutRig* wire) {
  write(m.rig, wire->mutable_rig());
}
void read(const v1::PutRig& wire, PutRig& m, Check& check) {
  read(wire.rig(), m.rig, check);
}

void write(const RigStored& m, v1::RigStored* wire) {
  wire->set_rig_id(m.rig_id);
}
void read(const v1::RigStored& wire, RigStored& m, Check&) {
  m.rig_id = wire.rig_id();
}

void write(const LivePlan& m, v1::LivePlan* wire) {
  wire->set_on(m.on);
  if (m.on) write(m.processing, wire->mutable_processing());
}
void read(const v1::LivePlan& wire, LivePlan& m, Check& check) {
  m.on = wire.on();
  if (m.on) read(wire.processing(), m.processing, check);
}

void write(const Submit& m, v1::Submit* wire) {
  write_all(m.captures, wire->mutable_captures());
  write_all(m.sets, wire->mutable_sets());
  wire->set_combine(std::string(name_of(m.combine)));
  write(m.processing, wire->mutable_processing());
  wire->set_priority(std::string(name_of(m.priority)));
  wire->set_submitter(m.submitter);
}
void read(const v1::Submit& wire, Submit& m, Check& check) {
  for (const std::string& capture : wire.captures()) {
    check.name(capture, "capture");
    m.captures.push_back(capture);
  }
  read_all(wire.sets(), m.sets, check);
  read_enum(wire.combine(), one_of(wire.combine(), {Combine::Each, Combine::Mean}), m.combine, "combine",
            check);
  read(wire.processing(), m.processing, check);
  read_priority(wire.priority(), m.priority, check);
  m.submitter = wire.submitter();
  check.optional_name(m.submitter, "submitter");
}

void write(const Submitted& m, v1::Submitted* wire) {
  for (std::int64_t id : m.job_ids) wire->add_job_ids(id);
  write_all(m.run_ids, wire->mutable_run_ids());
  wire->set_identical(m.identical);
  wire->set_submission(m.submission);
}
void read(const v1::Submitted& wire, Submitted& m, Check&) {
  m.job_ids.assign(wire.job_ids().begin(), wire.job_ids().end());
  m.run_ids.assign(wire.run_ids().begin(), wire.run_ids().end());
  m.identical = wire.identical();
  m.submission = wire.submission();
}

void write(const PutMetrics& m, v1::PutMetrics* wire) {
  wire->set_run_id(m.run_id);
  for (const auto& [key, value] : m.metrics) (*wire->mutable_metrics())[key] = value;
}
void read(const v1::PutMetrics& wire, PutMetrics& m, Check& check) {
  m.run_id = wire.run_id();
  read_numbers(wire.metrics(), m.metrics, "metrics", check);
}

void write(const GetStatus&, v1::GetStatus*) {}
void read(const v1::GetStatus&, GetStatus&, Check&) {}

void write(const Status& m, v1::Status* wire) {
  wire->set_program_version(m.program_version);
  wire->set_sets(m.sets);
  wire->set_runs(m.runs);
  wire->set_queued(m.queued);
  wire->set_leased(m.leased);
  wire->set_done(m.done);
  wire->set_failed(m.failed);
  for (const auto& worker : m.workers) {
    auto* out = wire->add_workers();
    out->set_name(worker.name);
    out->set_job_id(worker.job_id);
    out->set_silent_s(worker.silent_s);
    out->set_host(worker.host);
    out->set_threads(worker.threads);
    out->set_cores(worker.cores);
    out->set_memory_mib(worker.memory_mib);
  }
  for (const auto& waiting : m.waiting) {
    auto* out = wire->add_waiting();
    out->set_job_id(waiting.job_id);
    out->set_why(waiting.why);
  }
  for (const auto& [key, value] : m.counters) (*wire->mutable_counters())[key] = value;
  for (const auto& [key, value] : m.queued_by_priority) (*wire->mutable_queued_by_priority())[key] = value;
  wire->set_paused(m.paused);
}
void read(const v1::Status& wire, Status& m, Check& check) {
  m.program_version = wire.program_version();
  m.sets = wire.sets();
  m.runs = wire.runs();
  m.queued = wire.queued();
  m.leased = wire.leased();
  m.done = wire.done();
  m.failed = wire.failed();
  for (const auto& worker : wire.workers()) {
    check.finite(worker.silent_s(), "silent_s");
    m.workers.push_back({worker.name(), worker.job_id(), worker.silent_s(), worker.host(), worker.threads(),
                         worker.cores(), worker.memory_mib()});
  }
  for (const auto& waiting : wire.waiting()) m.waiting.push_back({waiting.job_id(), waiting.why()});
  for (const auto& [key, value] : wire.counters()) m.counters[key] = value;
  for (const auto& [key, value] : wire.queued_by_priority()) m.queued_by_priority[key] = value;
  m.paused = wire.paused();
}

}  // namespace flamefield
