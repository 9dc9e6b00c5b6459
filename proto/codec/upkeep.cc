// Messages that keep the books in order.
#include "proto/codec/wire.h"

namespace flamefield {

namespace {

constexpr int kMaxTextBytes = 64 << 10;
constexpr int kMaxEntries = 10'000;

void check_text(const std::string& text, std::string_view field, Check& check) {
  check.require(text.size() <= kMaxTextBytes, field, "is longer than 64 KiB");
}

template <class Wire>
void read_texts(const Wire& wire, std::vector<std::string>& out, std::string_view field, Check& check) {
  check.require(wire.size() <= kMaxEntries, field, "has more than 10 000 entries");
  out.assign(wire.begin(), wire.end());
  for (const std::string& text : out) check_text(text, field, check);
}

void write(const ReprocessOrder& order, v1::ReprocessOrder* wire) {
  wire->set_where(order.where);
  wire->set_stale(order.stale);
  wire->set_rig_id(order.rig_id);
  wire->set_recipe(order.recipe);
  for (const std::string& setting : order.settings) wire->add_settings(setting);
  for (const std::string& sweep : order.sweep) wire->add_sweep(sweep);
}
void read(const v1::ReprocessOrder& wire, ReprocessOrder& order, Check& check) {
  order.where = wire.where();
  order.stale = wire.stale();
  order.rig_id = wire.rig_id();
  order.recipe = wire.recipe();
  check_text(order.where, "where", check);
  check_text(order.recipe, "recipe", check);
  check.optional_name(order.rig_id, "rig");
  read_texts(wire.settings(), order.settings, "settings", check);
  read_texts(wire.sweep(), order.sweep, "sweep", check);
}

}  // namespace

void write(const PutTags& m, v1::PutTags* wire) {
  wire->set_subject(m.subject);
  write_all(m.add, wire->mutable_add());
  write_all(m.remove, wire->mutable_remove());
}
void read(const v1::PutTags& wire, PutTags& m, Check& check) {
  m.subject = wire.subject();
  read_texts(wire.add(), m.add, "tag", check);
  read_texts(wire.remove(), m.remove, "tag", check);
  for (const std::string& tag : m.add) check.name(tag, "tag");
}

void write(const AcceptRig& m, v1::AcceptRig* wire) {
  wire->set_rig_id(m.rig_id);
  wire->set_since_ns(m.since_ns);
}
void read(const v1::AcceptRig& wire, AcceptRig& m, Check& check) {
  m.rig_id = wire.rig_id();
  m.since_ns = wire.since_ns();
  check.name(m.rig_id, "rig");
}

void write(const Schedule& schedule, v1::Schedule* wire) {
  wire->set_name(schedule.name);
  wire->set_cron(schedule.cron);
  wire->set_zone(schedule.zone);
  wire->set_missed(std::string(name_of(schedule.missed)));
  wire->set_overlap(std::string(name_of(schedule.overlap)));
  write(schedule.order, wire->mutable_order());
  wire->set_created_time_ns(schedule.created_time_ns);
  wire->set_last_due_ns(schedule.last_due_ns);
}
void read(const v1::Schedule& wire, Schedule& schedule, Check& check) {
  schedule.name = wire.name();
  schedule.cron = wire.cron();
  schedule.zone = wire.zone();
  check.name(schedule.name, "schedule");
  check.require(schedule.cron.size() <= 200, "cron", "is longer than 200 characters");
  check.require(schedule.zone.size() <= 100, "zone", "is longer than 100 characters");
  read_enum(wire.missed(), missed_runs_from_name(wire.missed()), schedule.missed, "missed", check);
  read_enum(wire.overlap(), overlap_runs_from_name(wire.overlap()), schedule.overlap, "overlap", check);
  read(wire.order(), schedule.order, check);
  schedule.created_time_ns = wire.created_time_ns();
  schedule.last_due_ns = wire.last_due_ns();
}

void write(const PutSchedule& m, v1::PutSchedule* wire) {
  write(m.schedule, wire->mutable_schedule());
}
void read(const v1::PutSchedule& wire, PutSchedule& m, Check& check) {
  read(wire.schedule(), m.schedule, check);
}

void write(const DropSchedule& m, v1::DropSchedule* wire) {
  wire->set_name(m.name);
}
void read(const v1::DropSchedule& wire, DropSchedule& m, Check& check) {
  m.name = wire.name();
  check.name(m.name, "schedule");
}

void write(const ScheduleRan& m, v1::ScheduleRan* wire) {
  wire->set_name(m.name);
  wire->set_due_ns(m.due_ns);
  wire->set_time_ns(m.time_ns);
  wire->set_outcome(m.outcome);
  wire->set_text(m.text);
  for (std::int64_t id : m.job_ids) wire->add_job_ids(id);
}
void read(const v1::ScheduleRan& wire, ScheduleRan& m, Check& check) {
  m = {wire.name(),    wire.due_ns(), wire.time_ns(),
       wire.outcome(), wire.text(),   {wire.job_ids().begin(), wire.job_ids().end()}};
  check.name(m.name, "schedule");
  check.name(m.outcome, "outcome");
  check_text(m.text, "text", check);
}

void write(const Retire& m, v1::Retire* wire) {
  write_all(m.run_ids, wire->mutable_run_ids());
}
void read(const v1::Retire& wire, Retire& m, Check& check) {
  read_texts(wire.run_ids(), m.run_ids, "run", check);
}

}  // namespace flamefield
