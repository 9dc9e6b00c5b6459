// What is to be done: recipe, grid, processing, job.
#include "proto/codec/wire.h"

namespace flamefield {

void write(const Recipe& recipe, v1::Recipe* wire) {
  wire->set_solver(recipe.solver);
  for (const auto& [key, setting] : recipe.settings) {
    v1::Setting& out = (*wire->mutable_settings())[key];
    if (const auto* truth = std::get_if<bool>(&setting)) out.set_truth(*truth);
    if (const auto* integer = std::get_if<std::int64_t>(&setting)) out.set_integer(*integer);
    if (const auto* real = std::get_if<double>(&setting)) out.set_real(*real);
    if (const auto* text = std::get_if<std::string>(&setting)) out.set_text(*text);
  }
}

void read(const v1::Recipe& wire, Recipe& recipe, Check& check) {
  recipe.solver = wire.solver();
  for (const auto& [key, setting] : wire.settings()) {
    Setting& out = recipe.settings[key];
    switch (setting.value_case()) {
      case v1::Setting::kTruth:
        out = setting.truth();
        break;
      case v1::Setting::kInteger:
        out = static_cast<std::int64_t>(setting.integer());
        break;
      case v1::Setting::kReal:
        check.finite(setting.real(), "recipe setting");
        out = setting.real();
        break;
      case v1::Setting::kText:
        out = setting.text();
        break;
      case v1::Setting::VALUE_NOT_SET:
        check.require(false, "recipe setting", "has no value");
    }
  }
}

void write(const Grid& grid, v1::Grid* wire) {
  wire->set_nx(grid.nx);
  wire->set_ny(grid.ny);
  wire->set_nz(grid.nz);
  for (Eigen::Index a = 0; a < 3; ++a) {
    wire->add_spacing_mm(grid.spacing_mm[a]);
    wire->add_origin_mm(grid.origin_mm[a]);
  }
}

void read(const v1::Grid& wire, Grid& grid, Check& check) {
  const bool complete = wire.spacing_mm_size() == 3 && wire.origin_mm_size() == 3;
  check.require(complete, "grid", "needs 3 spacing and 3 origin numbers");
  if (!complete) return;
  grid.nx = wire.nx();
  grid.ny = wire.ny();
  grid.nz = wire.nz();
  for (int a = 0; a < 3; ++a) {
    grid.spacing_mm[a] = wire.spacing_mm(a);
    grid.origin_mm[a] = wire.origin_mm(a);
  }
  check.result(validate(grid), "grid");
}

void write(const Processing& processing, v1::Processing* wire) {
  wire->set_rig_id(processing.rig_id);
  write(processing.recipe, wire->mutable_recipe());
  write(processing.grid, wire->mutable_grid());
  wire->set_dark_capture(processing.dark_capture);
  wire->set_background_capture(processing.background_capture);
  wire->set_flat_capture(processing.flat_capture);
}

void read(const v1::Processing& wire, Processing& processing, Check& check) {
  processing.rig_id = wire.rig_id();
  processing.dark_capture = wire.dark_capture();
  processing.background_capture = wire.background_capture();
  processing.flat_capture = wire.flat_capture();
  check.name(processing.rig_id, "rig id");
  check.optional_name(processing.dark_capture, "dark capture");
  check.optional_name(processing.background_capture, "background capture");
  check.optional_name(processing.flat_capture, "flat capture");
  read(wire.recipe(), processing.recipe, check);
  read(wire.grid(), processing.grid, check);
}

void write(const Job& job, v1::Job* wire) {
  wire->set_id(job.id);
  wire->set_run_id(job.run_id);
  write_all(job.inputs, wire->mutable_inputs());
  write(job.processing, wire->mutable_processing());
  write_all(job.dark, wire->mutable_dark());
  write_all(job.background, wire->mutable_background());
  write_all(job.flat, wire->mutable_flat());
  wire->set_priority(std::string(name_of(job.priority)));
  wire->set_attempt(job.attempt);
  wire->set_created_time_ns(job.created_time_ns);
  wire->set_program_version(job.program_version);
  wire->set_submitter(job.submitter);
  wire->set_submission(job.submission);
  wire->set_estimated_s(job.estimated_s);
  wire->set_estimated_mib(job.estimated_mib);
}

void read_priority(const std::string& text, Priority& priority, Check& check) {
  const std::string name = text == "batch" ? "interactive" : text;  // in ledgers of older programs
  read_enum(name, priority_from_name(name), priority, "priority", check);
}

void read(const v1::Job& wire, Job& job, Check& check) {
  job.id = wire.id();
  job.run_id = wire.run_id();
  job.attempt = wire.attempt();
  job.created_time_ns = wire.created_time_ns();
  job.program_version = wire.program_version();
  job.submitter = wire.submitter();
  job.submission = wire.submission();
  job.estimated_s = wire.estimated_s();
  job.estimated_mib = wire.estimated_mib();
  check.optional_name(job.submitter, "submitter");
  check.finite(job.estimated_s, "estimated_s");
  check.finite(job.estimated_mib, "estimated_mib");
  check.require(is_file_safe(job.run_id), "run id", "is not a name");
  read_all(wire.inputs(), job.inputs, check);
  read_all(wire.dark(), job.dark, check);
  read_all(wire.background(), job.background, check);
  read_all(wire.flat(), job.flat, check);
  check.require(!job.inputs.empty(), "job", "has no inputs");
  read(wire.processing(), job.processing, check);
  read_priority(wire.priority(), job.priority, check);
}

}  // namespace flamefield
