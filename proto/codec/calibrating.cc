// Messages of a calibration session.
#include "proto/codec/wire.h"

namespace flamefield {

void write(const BoardSpec& board, v1::BoardSpec* wire) {
  wire->set_cols(board.cols);
  wire->set_rows(board.rows);
  wire->set_square_mm(board.square_mm);
  wire->set_kind(std::string(name_of(board.kind)));
  wire->set_marker_mm(board.marker_mm);
  wire->set_dictionary(board.dictionary);
}
void read(const v1::BoardSpec& wire, BoardSpec& board, Check& check) {
  board.cols = wire.cols();
  board.rows = wire.rows();
  board.square_mm = wire.square_mm();
  board.marker_mm = wire.marker_mm();
  board.dictionary = wire.dictionary();
  read_enum(wire.kind(), board_kind_from_name(wire.kind()), board.kind, "kind of board", check);
  check.optional_name(board.dictionary, "dictionary");
  if (check.problem().empty()) check.result(validate(board), "board");
}

void write(const StartCalibration& m, v1::StartCalibration* wire) {
  if (m.board) write(*m.board, wire->mutable_board());
  if (m.reference_centre_mm)
    for (double mm : *m.reference_centre_mm) wire->add_reference_centre_mm(mm);
  if (m.reference_azimuth_rad) wire->set_reference_azimuth_rad(*m.reference_azimuth_rad);
  wire->set_wanted_poses(m.wanted_poses);
  wire->set_automatic(m.automatic);
}
void read(const v1::StartCalibration& wire, StartCalibration& m, Check& check) {
  if (wire.has_board()) read(wire.board(), m.board.emplace(), check);
  const auto& centre = wire.reference_centre_mm();
  check.require(centre.empty() || centre.size() == 3, "reference centre", "needs three numbers");
  for (double mm : centre) check.finite(mm, "reference centre");
  if (centre.size() == 3) m.reference_centre_mm = {centre[0], centre[1], centre[2]};
  if (wire.has_reference_azimuth_rad()) m.reference_azimuth_rad = wire.reference_azimuth_rad();
  if (m.reference_azimuth_rad) check.finite(*m.reference_azimuth_rad, "reference azimuth");
  m.wanted_poses = wire.wanted_poses();
  m.automatic = wire.automatic();
  check.require(m.wanted_poses >= 2 && m.wanted_poses <= 1000, "poses", "not between 2 and 1000");
}

void write(const TakePose&, v1::TakePose*) {}
void read(const v1::TakePose&, TakePose&, Check&) {}
void write(const SolveCalibration&, v1::SolveCalibration*) {}
void read(const v1::SolveCalibration&, SolveCalibration&, Check&) {}
void write(const DiscardCalibration&, v1::DiscardCalibration*) {}
void read(const v1::DiscardCalibration&, DiscardCalibration&, Check&) {}
void write(const GetCalibration&, v1::GetCalibration*) {}
void read(const v1::GetCalibration&, GetCalibration&, Check&) {}

void write(const AcceptCalibration& m, v1::AcceptCalibration* wire) {
  wire->set_accepted_by(m.accepted_by);
  wire->set_note(m.note);
}
void read(const v1::AcceptCalibration& wire, AcceptCalibration& m, Check& check) {
  m.accepted_by = wire.accepted_by();
  m.note = wire.note();
  check.require(m.accepted_by.size() <= 200 && m.note.size() <= 10'000, "note", "is too long");
}

void write(const CalibrationState& m, v1::CalibrationState* wire) {
  wire->set_phase(std::string(name_of(m.phase)));
  wire->set_id(m.id);
  wire->set_automatic(m.automatic);
  wire->set_wanted_poses(m.wanted_poses);
  wire->set_poses(m.poses);
  wire->set_still(m.still);
  wire->set_is_new(m.is_new);
  wire->set_message(m.message);
  wire->set_error(m.error);
  for (const CalibrationState::CameraState& camera : m.cameras) {
    auto* out = wire->add_cameras();
    out->set_name(camera.name);
    out->set_sees_board(camera.sees_board);
    out->set_last_reason(camera.last_reason);
    for (double v : camera.corners_px) out->add_corners_px(v);
    out->set_boards(camera.boards);
    out->set_coverage(camera.coverage);
    for (bool v : camera.covered) out->add_covered(v);
    for (double v : camera.region_px) out->add_region_px(v);
    out->set_expected_px(camera.expected_px);
    out->set_shift_px(camera.shift_px);
    out->set_moved(camera.moved);
  }
  write_all(m.needed, wire->mutable_needed());
  for (const CalibrationState::Link& link : m.links_missing) {
    auto* out = wire->add_links_missing();
    out->set_a(link.a);
    out->set_b(link.b);
  }
  wire->set_volume_coverage(m.volume_coverage);
  wire->set_verdict(m.verdict);
  wire->set_rms_px(m.rms_px);
  wire->set_volume_mean_px(m.volume_mean_px);
  wire->set_volume_worst_px(m.volume_worst_px);
  wire->set_worst_camera(m.worst_camera);
  wire->set_previous_version(m.previous_version);
  write_all(m.moved, wire->mutable_moved());
  wire->set_accepted_version(m.accepted_version);
  wire->set_report(m.report);
  wire->set_board(m.board);
}
void read(const v1::CalibrationState& wire, CalibrationState& m, Check& check) {
  read_enum(wire.phase(),
            one_of(wire.phase(), {CalibrationPhase::Idle, CalibrationPhase::Detecting,
                                  CalibrationPhase::Solving, CalibrationPhase::Solved}),
            m.phase, "phase of the calibration", check);
  m.id = wire.id();
  check.optional_name(m.id, "session");
  m.automatic = wire.automatic();
  m.wanted_poses = wire.wanted_poses();
  m.poses = wire.poses();
  m.still = wire.still();
  m.is_new = wire.is_new();
  m.message = wire.message();
  m.error = wire.error();
  check.require(wire.cameras_size() <= kMaxCameras, "calibration", "more than 256 cameras");
  for (const auto& in : wire.cameras()) {
    CalibrationState::CameraState camera;
    camera.name = in.name();
    check.name(camera.name, "camera");
    camera.sees_board = in.sees_board();
    camera.last_reason = in.last_reason();
    camera.corners_px.assign(in.corners_px().begin(), in.corners_px().end());
    camera.boards = in.boards();
    camera.coverage = in.coverage();
    camera.covered.assign(in.covered().begin(), in.covered().end());
    camera.region_px.assign(in.region_px().begin(), in.region_px().end());
    camera.expected_px = in.expected_px();
    camera.shift_px = in.shift_px();
    camera.moved = in.moved();
    for (double v : {camera.coverage, camera.expected_px, camera.shift_px}) check.finite(v, "camera");
    m.cameras.push_back(std::move(camera));
  }
  m.needed.assign(wire.needed().begin(), wire.needed().end());
  for (const auto& link : wire.links_missing()) m.links_missing.push_back({link.a(), link.b()});
  m.volume_coverage = wire.volume_coverage();
  m.verdict = wire.verdict();
  m.rms_px = wire.rms_px();
  m.volume_mean_px = wire.volume_mean_px();
  m.volume_worst_px = wire.volume_worst_px();
  for (double v : {m.volume_coverage, m.rms_px, m.volume_mean_px, m.volume_worst_px})
    check.finite(v, "calibration");
  m.worst_camera = wire.worst_camera();
  m.previous_version = wire.previous_version();
  m.moved.assign(wire.moved().begin(), wire.moved().end());
  m.accepted_version = wire.accepted_version();
  m.report = wire.report();
  m.board = wire.board();
}

void write(const Calibration& c, v1::Calibration* wire) {
  wire->set_version(c.version);
  wire->set_predecessor(c.predecessor);
  wire->set_rig_id(c.rig_id);
  wire->set_accepted_time_ns(c.accepted_time_ns);
  wire->set_accepted_by(c.accepted_by);
  wire->set_note(c.note);
  wire->set_capture(c.capture);
  wire->set_poses(c.poses);
  wire->set_rms_px(c.rms_px);
  wire->set_volume_mean_px(c.volume_mean_px);
  wire->set_volume_worst_px(c.volume_worst_px);
  wire->set_worst_camera(c.worst_camera);
  wire->set_verdict(c.verdict);
  write_all(c.moved, wire->mutable_moved());
  wire->set_worst_shift_px(c.worst_shift_px);
  wire->set_most_shifted(c.most_shifted);
}
void read(const v1::Calibration& wire, Calibration& c, Check& check) {
  c.version = wire.version();
  c.predecessor = wire.predecessor();
  c.rig_id = wire.rig_id();
  c.accepted_time_ns = wire.accepted_time_ns();
  c.accepted_by = wire.accepted_by();
  c.note = wire.note();
  c.capture = wire.capture();
  c.poses = wire.poses();
  c.rms_px = wire.rms_px();
  c.volume_mean_px = wire.volume_mean_px();
  c.volume_worst_px = wire.volume_worst_px();
  c.worst_camera = wire.worst_camera();
  c.verdict = wire.verdict();
  c.moved.assign(wire.moved().begin(), wire.moved().end());
  c.worst_shift_px = wire.worst_shift_px();
  c.most_shifted = wire.most_shifted();
  check.optional_name(c.rig_id, "rig");
  check.optional_name(c.capture, "capture");
  check.count(c.version, "version");
  for (double v : {c.rms_px, c.volume_mean_px, c.volume_worst_px, c.worst_shift_px})
    check.finite(v, "calibration");
  check.require(c.accepted_by.size() <= 200 && c.note.size() <= 10'000, "note", "is too long");
}

void write(const PutCalibration& m, v1::PutCalibration* wire) {
  write(m.calibration, wire->mutable_calibration());
  write(m.rig, wire->mutable_rig());
}
void read(const v1::PutCalibration& wire, PutCalibration& m, Check& check) {
  read(wire.calibration(), m.calibration, check);
  read(wire.rig(), m.rig, check);
}

void write(const CalibrationStored& m, v1::CalibrationStored* wire) {
  wire->set_version(m.version);
  wire->set_rig_id(m.rig_id);
}
void read(const v1::CalibrationStored& wire, CalibrationStored& m, Check& check) {
  m.version = wire.version();
  m.rig_id = wire.rig_id();
  check.name(m.rig_id, "rig");
}

}  // namespace flamefield
