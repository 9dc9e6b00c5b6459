// Messages between dispatcher and worker.
#include "proto/codec/wire.h"

namespace flamefield {

void write(const Ready& m, v1::Ready* wire) {
  wire->set_worker(m.worker);
  wire->set_program_version(m.program_version);
  wire->set_threads(m.threads);
  wire->set_host(m.host);
  wire->set_cores(m.cores);
  wire->set_memory_mib(m.memory_mib);
  wire->set_data_id(m.data_id);
  wire->set_live_only(m.live_only);
  wire->set_own_memory(m.own_memory);
}
void read(const v1::Ready& wire, Ready& m, Check& check) {
  m = {wire.worker(),     wire.program_version(), wire.threads(),   wire.host(),      wire.cores(),
       wire.memory_mib(), wire.data_id(),         wire.live_only(), wire.own_memory()};
  check.name(m.worker, "worker");
  check.count(m.cores, "cores");
  check.count(m.memory_mib, "memory_mib");
}

void write(const Lease& m, v1::Lease* wire) {
  wire->set_token(m.token);
  wire->set_duration_ms(m.duration_ms);
  write(m.job, wire->mutable_job());
  if (!m.rig.cameras.empty()) write(m.rig, wire->mutable_rig());
}
void read(const v1::Lease& wire, Lease& m, Check& check) {
  m.token = wire.token();
  m.duration_ms = wire.duration_ms();
  check.count(m.duration_ms, "lease duration");
  read(wire.job(), m.job, check);
  if (wire.has_rig()) read(wire.rig(), m.rig, check);
}

void write(const FetchSet& m, v1::FetchSet* wire) {
  write(m.id, wire->mutable_id());
}
void read(const v1::FetchSet& wire, FetchSet& m, Check& check) {
  read(wire.id(), m.id, check);
}

void write(const SetData& m, v1::SetData* wire) {
  write(m.set, wire->mutable_set());
}
void read(const v1::SetData& wire, SetData& m, Check& check) {
  read(wire.set(), m.set, check);
}

void write(const Heartbeat& m, v1::Heartbeat* wire) {
  write(m.progress, wire->mutable_progress());
}
void read(const v1::Heartbeat& wire, Heartbeat& m, Check& check) {
  read(wire.progress(), m.progress, check);
}

void write(const LeaseLost& m, v1::LeaseLost* wire) {
  wire->set_token(m.token);
}
void read(const v1::LeaseLost& wire, LeaseLost& m, Check&) {
  m.token = wire.token();
}

void write(const Finish& m, v1::Finish* wire) {
  wire->set_token(m.token);
  write(m.run, wire->mutable_run());
}
void read(const v1::Finish& wire, Finish& m, Check& check) {
  m.token = wire.token();
  read(wire.run(), m.run, check);
}

void write(const Committed& m, v1::Committed* wire) {
  wire->set_run_id(m.run_id);
}
void read(const v1::Committed& wire, Committed& m, Check&) {
  m.run_id = wire.run_id();
}

void write(const Fail& m, v1::Fail* wire) {
  wire->set_token(m.token);
  write(m.error, wire->mutable_error());
  wire->set_crashed(m.crashed);
}
void read(const v1::Fail& wire, Fail& m, Check& check) {
  m.token = wire.token();
  read(wire.error(), m.error, check);
  m.crashed = wire.crashed();
}

}  // namespace flamefield
