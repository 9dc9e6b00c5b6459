#include "proto/codec.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <cmath>

#include "flamefield/v1/bus.pb.h"

// Two overload sets, one per direction: write(value, wire) and read(wire, value, check). They mirror the
// .proto files message by message, so that a new field is two lines here.
namespace flamefield {

namespace {

// Remembers the first thing that was wrong.
class Check {
 public:
  void require(bool holds, std::string_view field, std::string_view why) {
    if (!holds && problem_.empty()) problem_ = concat(field, ": ", why);
  }
  void finite(double value, std::string_view field) {
    require(std::isfinite(value), field, "is not a finite number");
  }
  void count(std::int64_t value, std::string_view field) { require(value >= 0, field, "is negative"); }
  void name(const std::string& text, std::string_view field) {
    require(text.size() <= 100 && is_file_safe(text), field,
            "is not a name (letters, digits, '.', '_', '-', at most 100)");
  }
  void optional_name(const std::string& text, std::string_view field) {
    if (!text.empty()) name(text, field);
  }
  void result(const Result<>& result, std::string_view field) {
    if (!result) require(false, field, result.error().message);
  }
  const std::string& problem() const { return problem_; }

 private:
  std::string problem_;
};

template <class Enum>
void read_enum(const std::string& text, std::optional<Enum> found, Enum& out, std::string_view field,
               Check& check) {
  check.require(found.has_value(), field, concat("unknown value '", text.substr(0, 40), "'"));
  if (found) out = *found;
}

template <class Enum>
std::optional<Enum> one_of(const std::string& text, std::initializer_list<Enum> values) {
  for (Enum value : values) {
    if (name_of(value) == text) return value;
  }
  return std::nullopt;
}

// Elements of repeated fields; declared here because the templates below look them up.
void write(const SetId& id, v1::SetId* wire);
void read(const v1::SetId& wire, SetId& id, Check& check);
void write(const Frame& frame, v1::Frame* wire);
void read(const v1::Frame& wire, Frame& frame, Check& check);
void write(const FrameLoss& loss, v1::FrameLoss* wire);
void read(const v1::FrameLoss& wire, FrameLoss& loss, Check& check);
void write(const Camera& camera, v1::Camera* wire);
void read(const v1::Camera& wire, Camera& camera, Check& check);
void write(const CameraQuality& quality, v1::CameraQuality* wire);
void read(const v1::CameraQuality& wire, CameraQuality& quality, Check& check);

// Repeated fields and maps.
template <class T, class Wire>
void write_all(const std::vector<T>& values, Wire* wire) {
  for (const T& value : values) {
    if constexpr (requires { write(value, wire->Add()); })
      write(value, wire->Add());
    else
      *wire->Add() = value;
  }
}

template <class T, class Wire>
void read_all(const Wire& wire, std::vector<T>& values, Check& check) {
  values.resize(static_cast<std::size_t>(wire.size()));
  for (int i = 0; i < wire.size(); ++i) read(wire[i], values[static_cast<std::size_t>(i)], check);
}

template <class Wire>
void read_numbers(const Wire& wire, std::map<std::string, double>& values, std::string_view field,
                  Check& check) {
  for (const auto& [key, value] : wire) {
    check.finite(value, field);
    values[key] = value;
  }
}

// --- sets

void write(const SetId& id, v1::SetId* wire) {
  wire->set_capture(id.capture);
  wire->set_index(id.index);
}

void read(const v1::SetId& wire, SetId& id, Check& check) {
  id = {wire.capture(), wire.index()};
  check.name(id.capture, "capture");
  check.count(id.index, "set index");
}

void write(const Frame& frame, v1::Frame* wire) {
  wire->set_camera(frame.camera);
  wire->set_pulse(frame.pulse);
  wire->set_device_time_ns(frame.device_time_ns);
  wire->set_arrival_time_ns(frame.arrival_time_ns);
  wire->set_exposure_us(frame.exposure_us);
  wire->set_width_px(frame.width_px);
  wire->set_height_px(frame.height_px);
  wire->set_pixel_format(std::string(name_of(frame.format)));
  wire->set_bytes(frame.bytes ? static_cast<std::int64_t>(frame.bytes->size()) : 0);
}

void read(const v1::Frame& wire, Frame& frame, Check& check) {
  frame.camera = wire.camera();
  frame.pulse = wire.pulse();
  frame.device_time_ns = wire.device_time_ns();
  frame.arrival_time_ns = wire.arrival_time_ns();
  frame.exposure_us = wire.exposure_us();
  frame.width_px = wire.width_px();
  frame.height_px = wire.height_px();
  check.name(frame.camera, "camera of a frame");
  check.count(frame.exposure_us, "exposure_us");
  read_enum(wire.pixel_format(), pixel_format_from_name(wire.pixel_format()), frame.format, "pixel format",
            check);
  const bool fits =
      frame.width_px > 0 && frame.height_px > 0 && frame.width_px <= 65536 && frame.height_px <= 65536;
  check.require(fits, "frame size", "each side must be 1 to 65536 px");
  if (!fits) return;
  const std::size_t wanted = bytes_of_image(frame.format, frame.width_px, frame.height_px);
  check.require(wanted <= kMaxFrameBytes, "frame size", "more than 256 MiB");
  check.require(wire.bytes() == static_cast<std::int64_t>(wanted), "frame bytes",
                "do not match size and format");
}

void write(const FrameLoss& loss, v1::FrameLoss* wire) {
  wire->set_camera(loss.camera);
  wire->set_cause(std::string(name_of(loss.cause)));
}

void read(const v1::FrameLoss& wire, FrameLoss& loss, Check& check) {
  loss.camera = wire.camera();
  check.name(loss.camera, "camera of a loss");
  read_enum(wire.cause(), loss_cause_from_name(wire.cause()), loss.cause, "loss cause", check);
}

void write(const FrameSet& set, v1::FrameSet* wire) {
  wire->set_capture(set.capture);
  wire->set_kind(std::string(name_of(set.kind)));
  wire->set_pulse(set.pulse);
  wire->set_index(set.index);
  wire->set_pulse_time_ns(set.pulse_time_ns);
  wire->set_complete_time_ns(set.complete_time_ns);
  write_all(set.frames, wire->mutable_frames());
  write_all(set.losses, wire->mutable_losses());
}

void read(const v1::FrameSet& wire, FrameSet& set, Check& check) {
  check.require(wire.frames_size() + wire.losses_size() <= kMaxCameras, "frame set", "more than 256 cameras");
  if (!check.problem().empty()) return;
  set.capture = wire.capture();
  set.pulse = wire.pulse();
  set.index = wire.index();
  set.pulse_time_ns = wire.pulse_time_ns();
  set.complete_time_ns = wire.complete_time_ns();
  check.name(set.capture, "capture");
  check.count(set.index, "set index");
  read_enum(wire.kind(), capture_kind_from_name(wire.kind()), set.kind, "capture kind", check);
  read_all(wire.frames(), set.frames, check);
  read_all(wire.losses(), set.losses, check);
}

// --- rig

void write(const Camera& camera, v1::Camera* wire) {
  wire->set_name(camera.name);
  wire->set_image_width_px(camera.image_width_px);
  wire->set_image_height_px(camera.image_height_px);
  wire->set_fx_px(camera.fx_px);
  wire->set_fy_px(camera.fy_px);
  wire->set_cx_px(camera.cx_px);
  wire->set_cy_px(camera.cy_px);
  for (double d : camera.distortion) wire->add_distortion(d);
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) wire->add_rotation(camera.camera_from_world.rotation(row, col));
    wire->add_translation_mm(camera.camera_from_world.translation_mm(row));
  }
}

void read(const v1::Camera& wire, Camera& camera, Check& check) {
  const bool complete =
      wire.distortion_size() == 5 && wire.rotation_size() == 9 && wire.translation_mm_size() == 3;
  check.require(complete, "camera", "needs 5 distortion, 9 rotation and 3 translation numbers");
  check.name(wire.name(), "camera name");
  if (!complete) return;
  camera.name = wire.name();
  camera.image_width_px = wire.image_width_px();
  camera.image_height_px = wire.image_height_px();
  camera.fx_px = wire.fx_px();
  camera.fy_px = wire.fy_px();
  camera.cx_px = wire.cx_px();
  camera.cy_px = wire.cy_px();
  for (int i = 0; i < 5; ++i) camera.distortion[static_cast<std::size_t>(i)] = wire.distortion(i);
  for (int i = 0; i < 9; ++i) camera.camera_from_world.rotation(i / 3, i % 3) = wire.rotation(i);
  for (int i = 0; i < 3; ++i) camera.camera_from_world.translation_mm(i) = wire.translation_mm(i);
}

void write(const CameraQuality& quality, v1::CameraQuality* wire) {
  wire->set_images(quality.images);
  wire->set_corners(quality.corners);
  wire->set_rejected_corners(quality.rejected_corners);
  wire->set_rms_px(quality.rms_px);
  wire->set_focal_sigma_px(quality.focal_sigma_px);
  wire->set_position_sigma_mm(quality.position_sigma_mm);
  wire->set_rotation_sigma_rad(quality.rotation_sigma_rad);
}

void read(const v1::CameraQuality& wire, CameraQuality& quality, Check& check) {
  quality = {wire.images(),         wire.corners(),           wire.rejected_corners(),  wire.rms_px(),
             wire.focal_sigma_px(), wire.position_sigma_mm(), wire.rotation_sigma_rad()};
  for (double v :
       {quality.rms_px, quality.focal_sigma_px, quality.position_sigma_mm, quality.rotation_sigma_rad})
    check.finite(v, "camera quality");
}

void write(const Rig& rig, v1::Rig* wire) {
  write_all(rig.cameras, wire->mutable_cameras());
  if (!rig.quality) return;
  wire->mutable_quality()->set_rms_px(rig.quality->rms_px);
  wire->mutable_quality()->set_board_poses(rig.quality->board_poses);
  write_all(rig.quality->cameras, wire->mutable_quality()->mutable_cameras());
}

void read(const v1::Rig& wire, Rig& rig, Check& check) {
  check.require(wire.cameras_size() <= kMaxCameras && wire.quality().cameras_size() <= kMaxCameras, "rig",
                "more than 256 cameras");
  if (!check.problem().empty()) return;
  read_all(wire.cameras(), rig.cameras, check);
  if (wire.has_quality()) {
    RigQuality& quality = rig.quality.emplace();
    quality.rms_px = wire.quality().rms_px();
    quality.board_poses = wire.quality().board_poses();
    check.finite(quality.rms_px, "rig quality");
    read_all(wire.quality().cameras(), quality.cameras, check);
  }
  if (check.problem().empty()) check.result(validate(rig), "rig");
}

// --- jobs and runs

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
}

void read_priority(const std::string& text, Priority& priority, Check& check) {
  read_enum(text, one_of(text, {Priority::Batch, Priority::Live}), priority, "priority", check);
}

void read(const v1::Job& wire, Job& job, Check& check) {
  job.id = wire.id();
  job.run_id = wire.run_id();
  job.attempt = wire.attempt();
  job.created_time_ns = wire.created_time_ns();
  job.program_version = wire.program_version();
  check.require(is_file_safe(job.run_id), "run id", "is not a name");
  read_all(wire.inputs(), job.inputs, check);
  read_all(wire.dark(), job.dark, check);
  read_all(wire.background(), job.background, check);
  read_all(wire.flat(), job.flat, check);
  check.require(!job.inputs.empty(), "job", "has no inputs");
  read(wire.processing(), job.processing, check);
  read_priority(wire.priority(), job.priority, check);
}

void write(const Progress& progress, v1::Progress* wire) {
  wire->set_token(progress.token);
  wire->set_run_id(progress.run_id);
  wire->set_stage(progress.stage);
  wire->set_iteration(progress.iteration);
  wire->set_max_iterations(progress.max_iterations);
  wire->set_residual(progress.residual);
  wire->set_elapsed_s(progress.elapsed_s);
}

void read(const v1::Progress& wire, Progress& progress, Check& check) {
  progress = {wire.token(),          wire.run_id(),   wire.stage(),    wire.iteration(),
              wire.max_iterations(), wire.residual(), wire.elapsed_s()};
  check.finite(progress.residual, "residual");
  check.finite(progress.elapsed_s, "elapsed_s");
}

void write(const Run& run, v1::Run* wire) {
  wire->set_id(run.id);
  wire->set_job_id(run.job_id);
  write_all(run.inputs, wire->mutable_inputs());
  write(run.processing, wire->mutable_processing());
  wire->set_program_version(run.program_version);
  wire->set_worker(run.worker);
  wire->set_volume_path(run.volume_path);
  wire->set_projections_path(run.projections_path);
  wire->set_volume_bytes(run.volume_bytes);
  wire->set_volume_fingerprint(run.volume_fingerprint);
  wire->set_solver(run.solver);
  wire->set_projector_engine(run.projector_engine);
  wire->set_stop_reason(run.stop_reason);
  wire->set_iterations(run.iterations);
  wire->set_residual(run.residual);
  wire->set_voxel_updates(run.voxel_updates);
  for (const auto& [camera, value] : run.residual_per_view)
    (*wire->mutable_residual_per_view())[camera] = value;
  for (const auto& [key, value] : run.metrics) (*wire->mutable_metrics())[key] = value;
  write_all(run.provenance, wire->mutable_provenance());
  wire->set_queue_s(run.timings.queue_s);
  wire->set_fetch_s(run.timings.fetch_s);
  wire->set_prepare_s(run.timings.prepare_s);
  wire->set_solve_s(run.timings.solve_s);
  wire->set_write_s(run.timings.write_s);
  wire->set_started_time_ns(run.started_time_ns);
  wire->set_finished_time_ns(run.finished_time_ns);
}

// A path below the data directory: names joined by '/'.
void check_path(const std::string& path, std::string_view field, Check& check) {
  check.require(path.size() <= 400, field, "is too long");
  std::size_t from = 0;
  while (from <= path.size() && check.problem().empty()) {
    const std::size_t to = std::min(path.find('/', from), path.size());
    check.require(is_file_safe(path.substr(from, to - from)), field,
                  "is not a path below the data directory");
    from = to + 1;
  }
}

void read(const v1::Run& wire, Run& run, Check& check) {
  run.id = wire.id();
  run.job_id = wire.job_id();
  read_all(wire.inputs(), run.inputs, check);
  read(wire.processing(), run.processing, check);
  run.program_version = wire.program_version();
  run.worker = wire.worker();
  run.volume_path = wire.volume_path();
  run.projections_path = wire.projections_path();
  check_path(run.volume_path, "volume path", check);
  if (!run.projections_path.empty()) check_path(run.projections_path, "projections path", check);
  run.volume_bytes = wire.volume_bytes();
  run.volume_fingerprint = wire.volume_fingerprint();
  run.solver = wire.solver();
  run.projector_engine = wire.projector_engine();
  run.stop_reason = wire.stop_reason();
  run.iterations = wire.iterations();
  run.residual = wire.residual();
  run.voxel_updates = wire.voxel_updates();
  read_numbers(wire.residual_per_view(), run.residual_per_view, "residual per view", check);
  read_numbers(wire.metrics(), run.metrics, "metrics", check);
  run.provenance.assign(wire.provenance().begin(), wire.provenance().end());
  run.timings = {wire.queue_s(), wire.fetch_s(), wire.prepare_s(), wire.solve_s(), wire.write_s()};
  run.started_time_ns = wire.started_time_ns();
  run.finished_time_ns = wire.finished_time_ns();
  check.count(run.volume_bytes, "volume bytes");
  for (double v : {run.residual, run.voxel_updates, run.timings.queue_s, run.timings.fetch_s,
                   run.timings.prepare_s, run.timings.solve_s, run.timings.write_s})
    check.finite(v, "run");
}

// --- bus messages

void write(const Error& error, v1::Error* wire) {
  wire->set_code(std::string(name_of(error.code)));
  wire->set_message(error.message);
}

void read(const v1::Error& wire, Error& error, Check& check) {
  error.message = wire.message();
  read_enum(wire.code(),
            one_of(wire.code(), {ErrorCode::InvalidInput, ErrorCode::NotFound, ErrorCode::Unavailable,
                                 ErrorCode::DataLoss}),
            error.code, "error code", check);
}

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
}
void read(const v1::PutCapture& wire, PutCapture& m, Check& check) {
  m = {wire.id(), CaptureKind::Burst, wire.started_time_ns(), wire.finished_time_ns(), wire.pulses(), {}};
  check.name(m.id, "capture");
  check.count(m.pulses, "pulses");
  check.require(wire.cameras_size() <= kMaxCameras, "capture", "more than 256 cameras");
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
}

void write(const Submitted& m, v1::Submitted* wire) {
  for (std::int64_t id : m.job_ids) wire->add_job_ids(id);
  write_all(m.run_ids, wire->mutable_run_ids());
  wire->set_identical(m.identical);
}
void read(const v1::Submitted& wire, Submitted& m, Check&) {
  m.job_ids.assign(wire.job_ids().begin(), wire.job_ids().end());
  m.run_ids.assign(wire.run_ids().begin(), wire.run_ids().end());
  m.identical = wire.identical();
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
  }
  for (const auto& waiting : m.waiting) {
    auto* out = wire->add_waiting();
    out->set_job_id(waiting.job_id);
    out->set_why(waiting.why);
  }
  for (const auto& [key, value] : m.counters) (*wire->mutable_counters())[key] = value;
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
    m.workers.push_back({worker.name(), worker.job_id(), worker.silent_s()});
  }
  for (const auto& waiting : wire.waiting()) m.waiting.push_back({waiting.job_id(), waiting.why()});
  for (const auto& [key, value] : wire.counters()) m.counters[key] = value;
}

void write(const Ready& m, v1::Ready* wire) {
  wire->set_worker(m.worker);
  wire->set_program_version(m.program_version);
  wire->set_threads(m.threads);
}
void read(const v1::Ready& wire, Ready& m, Check& check) {
  m = {wire.worker(), wire.program_version(), wire.threads()};
  check.name(m.worker, "worker");
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
}
void read(const v1::Fail& wire, Fail& m, Check& check) {
  m.token = wire.token();
  read(wire.error(), m.error, check);
}

void write(const Accepted&, v1::Accepted*) {}
void read(const v1::Accepted&, Accepted&, Check&) {}

void write(const Rejected& m, v1::Rejected* wire) {
  write(m.error, wire->mutable_error());
}
void read(const v1::Rejected& wire, Rejected& m, Check& check) {
  read(wire.error(), m.error, check);
}

void write(const Event& m, v1::Event* wire) {
  wire->set_time_ns(m.time_ns);
  wire->set_kind(m.kind);
  wire->set_subject(m.subject);
  wire->set_text(m.text);
}
void read(const v1::Event& wire, Event& m, Check&) {
  m = {wire.time_ns(), wire.kind(), wire.subject(), wire.text()};
}

void write(const StartCapture& m, v1::StartCapture* wire) {
  wire->set_kind(std::string(name_of(m.kind)));
  wire->set_pulses(m.pulses);
  wire->set_id(m.id);
}
void read(const v1::StartCapture& wire, StartCapture& m, Check& check) {
  m.pulses = wire.pulses();
  m.id = wire.id();
  check.count(m.pulses, "pulses");
  check.optional_name(m.id, "capture");
  read_enum(wire.kind(), capture_kind_from_name(wire.kind()), m.kind, "capture kind", check);
}

void write(const StopCapture&, v1::StopCapture*) {}
void read(const v1::StopCapture&, StopCapture&, Check&) {}

void write(const GetCapture&, v1::GetCapture*) {}
void read(const v1::GetCapture&, GetCapture&, Check&) {}

void write(const GetPreview& m, v1::GetPreview* wire) {
  wire->set_camera(m.camera);
}
void read(const v1::GetPreview& wire, GetPreview& m, Check& check) {
  m.camera = wire.camera();
  check.name(m.camera, "camera");
}

void write(const CaptureState& m, v1::CaptureState* wire) {
  wire->set_phase(std::string(name_of(m.phase)));
  wire->set_id(m.id);
  wire->set_kind(std::string(name_of(m.kind)));
  wire->set_pulses_wanted(m.pulses_wanted);
  wire->set_sets(m.sets);
  wire->set_sets_stored(m.sets_stored);
  for (const CaptureState::CameraState& camera : m.cameras) {
    auto* out = wire->add_cameras();
    out->set_name(camera.name);
    out->set_address(camera.address);
    out->set_connected(camera.connected);
    out->set_frames(camera.frames);
    for (const auto& [cause, count] : camera.losses) (*out->mutable_losses())[cause] = count;
    out->set_newest_age_s(camera.newest_age_s);
  }
}
void read(const v1::CaptureState& wire, CaptureState& m, Check& check) {
  m = {CapturePhase::Idle, wire.id(), CaptureKind::Burst, wire.pulses_wanted(), wire.sets(),
       wire.sets_stored(), {}};
  read_enum(wire.phase(),
            one_of(wire.phase(), {CapturePhase::Idle, CapturePhase::Armed, CapturePhase::Draining}), m.phase,
            "capture phase", check);
  read_enum(wire.kind(), capture_kind_from_name(wire.kind()), m.kind, "capture kind", check);
  check.optional_name(m.id, "capture");
  check.require(wire.cameras_size() <= kMaxCameras, "capture", "more than 256 cameras");
  for (const auto& in : wire.cameras()) {
    CaptureState::CameraState camera{in.name(),   in.address(), in.connected(),
                                     in.frames(), {},           in.newest_age_s()};
    check.name(camera.name, "camera");
    check.finite(camera.newest_age_s, "age of the newest frame");
    for (const auto& [cause, count] : in.losses()) camera.losses[cause] = count;
    m.cameras.push_back(std::move(camera));
  }
}

// Calls visit(message field of `wire`, empty value of its C++ type) for the field that is set.
template <class Wire, class Visit>
bool visit_message(Wire& wire, Visit visit) {
  switch (wire.message_case()) {
    case v1::Envelope::kPutSet:
      return visit(wire.put_set(), PutSet());
    case v1::Envelope::kSetStored:
      return visit(wire.set_stored(), SetStored());
    case v1::Envelope::kPutCapture:
      return visit(wire.put_capture(), PutCapture());
    case v1::Envelope::kPutRig:
      return visit(wire.put_rig(), PutRig());
    case v1::Envelope::kRigStored:
      return visit(wire.rig_stored(), RigStored());
    case v1::Envelope::kLivePlan:
      return visit(wire.live_plan(), LivePlan());
    case v1::Envelope::kSubmit:
      return visit(wire.submit(), Submit());
    case v1::Envelope::kSubmitted:
      return visit(wire.submitted(), Submitted());
    case v1::Envelope::kPutMetrics:
      return visit(wire.put_metrics(), PutMetrics());
    case v1::Envelope::kGetStatus:
      return visit(wire.get_status(), GetStatus());
    case v1::Envelope::kStatus:
      return visit(wire.status(), Status());
    case v1::Envelope::kReady:
      return visit(wire.ready(), Ready());
    case v1::Envelope::kLease:
      return visit(wire.lease(), Lease());
    case v1::Envelope::kFetchSet:
      return visit(wire.fetch_set(), FetchSet());
    case v1::Envelope::kSetData:
      return visit(wire.set_data(), SetData());
    case v1::Envelope::kHeartbeat:
      return visit(wire.heartbeat(), Heartbeat());
    case v1::Envelope::kLeaseLost:
      return visit(wire.lease_lost(), LeaseLost());
    case v1::Envelope::kFinish:
      return visit(wire.finish(), Finish());
    case v1::Envelope::kCommitted:
      return visit(wire.committed(), Committed());
    case v1::Envelope::kFail:
      return visit(wire.fail(), Fail());
    case v1::Envelope::kAccepted:
      return visit(wire.accepted(), Accepted());
    case v1::Envelope::kRejected:
      return visit(wire.rejected(), Rejected());
    case v1::Envelope::kEvent:
      return visit(wire.event(), Event());
    case v1::Envelope::kStartCapture:
      return visit(wire.start_capture(), StartCapture());
    case v1::Envelope::kStopCapture:
      return visit(wire.stop_capture(), StopCapture());
    case v1::Envelope::kGetCapture:
      return visit(wire.get_capture(), GetCapture());
    case v1::Envelope::kGetPreview:
      return visit(wire.get_preview(), GetPreview());
    case v1::Envelope::kCaptureState:
      return visit(wire.capture_state(), CaptureState());
    case v1::Envelope::MESSAGE_NOT_SET:
      return false;
  }
  return false;
}

void write(const PutSet& m, v1::Envelope* wire) {
  write(m, wire->mutable_put_set());
}
void write(const SetStored& m, v1::Envelope* wire) {
  write(m, wire->mutable_set_stored());
}
void write(const PutCapture& m, v1::Envelope* wire) {
  write(m, wire->mutable_put_capture());
}
void write(const PutRig& m, v1::Envelope* wire) {
  write(m, wire->mutable_put_rig());
}
void write(const RigStored& m, v1::Envelope* wire) {
  write(m, wire->mutable_rig_stored());
}
void write(const LivePlan& m, v1::Envelope* wire) {
  write(m, wire->mutable_live_plan());
}
void write(const Submit& m, v1::Envelope* wire) {
  write(m, wire->mutable_submit());
}
void write(const Submitted& m, v1::Envelope* wire) {
  write(m, wire->mutable_submitted());
}
void write(const PutMetrics& m, v1::Envelope* wire) {
  write(m, wire->mutable_put_metrics());
}
void write(const GetStatus& m, v1::Envelope* wire) {
  write(m, wire->mutable_get_status());
}
void write(const Status& m, v1::Envelope* wire) {
  write(m, wire->mutable_status());
}
void write(const Ready& m, v1::Envelope* wire) {
  write(m, wire->mutable_ready());
}
void write(const Lease& m, v1::Envelope* wire) {
  write(m, wire->mutable_lease());
}
void write(const FetchSet& m, v1::Envelope* wire) {
  write(m, wire->mutable_fetch_set());
}
void write(const SetData& m, v1::Envelope* wire) {
  write(m, wire->mutable_set_data());
}
void write(const Heartbeat& m, v1::Envelope* wire) {
  write(m, wire->mutable_heartbeat());
}
void write(const LeaseLost& m, v1::Envelope* wire) {
  write(m, wire->mutable_lease_lost());
}
void write(const Finish& m, v1::Envelope* wire) {
  write(m, wire->mutable_finish());
}
void write(const Committed& m, v1::Envelope* wire) {
  write(m, wire->mutable_committed());
}
void write(const Fail& m, v1::Envelope* wire) {
  write(m, wire->mutable_fail());
}
void write(const Accepted& m, v1::Envelope* wire) {
  write(m, wire->mutable_accepted());
}
void write(const Rejected& m, v1::Envelope* wire) {
  write(m, wire->mutable_rejected());
}
void write(const Event& m, v1::Envelope* wire) {
  write(m, wire->mutable_event());
}

void write(const StartCapture& m, v1::Envelope* wire) {
  write(m, wire->mutable_start_capture());
}
void write(const StopCapture& m, v1::Envelope* wire) {
  write(m, wire->mutable_stop_capture());
}
void write(const GetCapture& m, v1::Envelope* wire) {
  write(m, wire->mutable_get_capture());
}
void write(const GetPreview& m, v1::Envelope* wire) {
  write(m, wire->mutable_get_preview());
}
void write(const CaptureState& m, v1::Envelope* wire) {
  write(m, wire->mutable_capture_state());
}

}  // namespace

std::string encode(const Message& message, std::uint64_t request) {
  v1::Envelope wire;
  wire.set_request(request);
  std::visit([&](const auto& m) { write(m, &wire); }, message);
  // Deterministic: maps in the order of their keys, so that equal messages are equal bytes.
  std::string bytes;
  google::protobuf::io::StringOutputStream stream(&bytes);
  google::protobuf::io::CodedOutputStream coded(&stream);
  coded.SetSerializationDeterministic(true);
  wire.SerializeToCodedStream(&coded);
  coded.Trim();
  return bytes;
}

Result<Envelope> decode(std::span<const std::byte> header) {
  const auto refuse = [](std::string_view why) {
    return invalid_input("message on the bus", why, "drop it; is the sender of another version?");
  };
  if (header.size() > kMaxHeaderBytes)
    return refuse(concat("its header is larger than ", kMaxHeaderBytes >> 20, " MiB"));
  v1::Envelope wire;
  if (!wire.ParseFromArray(header.data(), static_cast<int>(header.size())))
    return refuse("its header is not an Envelope");
  Check check;
  Envelope envelope;
  envelope.request = wire.request();
  const bool known = visit_message(wire, [&](const auto& field, auto value) {
    read(field, value, check);
    envelope.message = std::move(value);
    return true;
  });
  if (!known) return refuse("its kind is unknown");
  if (!check.problem().empty()) return refuse(check.problem());
  return envelope;
}

FrameSet* frame_set_of(Message& message) {
  if (auto* put = std::get_if<PutSet>(&message)) return &put->set;
  if (auto* data = std::get_if<SetData>(&message)) return &data->set;
  return nullptr;
}

const FrameSet* frame_set_of(const Message& message) {
  return frame_set_of(const_cast<Message&>(message));
}

Result<> attach_frames(FrameSet& set, std::vector<Bytes> parts) {
  bool fits = parts.size() == set.frames.size();
  for (std::size_t i = 0; fits && i < parts.size(); ++i) {
    const Frame& frame = set.frames[i];
    fits = parts[i] && parts[i]->size() == bytes_of_image(frame.format, frame.width_px, frame.height_px);
  }
  if (!fits) {
    return invalid_input(concat("set ", set.index, " of ", set.capture),
                         "its pixels do not match what its header announces", "send it again");
  }
  for (std::size_t i = 0; i < parts.size(); ++i) set.frames[i].bytes = std::move(parts[i]);
  return {};
}

}  // namespace flamefield
