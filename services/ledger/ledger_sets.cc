// The writer's part on captures and sets.
#include "services/ledger/writer.h"

namespace flamefield {

Result<> Ledger::put_capture(const PutCapture& capture) {
  return guarded(impl_->database, [&]() -> Result<> {
    std::string cameras;
    for (const std::string& camera : capture.cameras) cameras += (cameras.empty() ? "" : " ") + camera;
    std::string settings;
    for (const auto& [name, value] : capture.settings) settings += concat(name, "=", value, "\n");
    impl_->sql.run(
        "INSERT INTO captures(id, kind, started_time_ns, finished_time_ns, pulses, cameras, pulses_wanted, "
        "pre_pulses, ending, end_reason, settings) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11) "
        "ON CONFLICT(id) DO UPDATE SET kind = ?2, started_time_ns = ?3, finished_time_ns = ?4, pulses = ?5, "
        "cameras = ?6, pulses_wanted = ?7, pre_pulses = ?8, ending = ?9, end_reason = ?10, settings = ?11",
        capture.id, name_of(capture.kind), capture.started_time_ns, capture.finished_time_ns, capture.pulses,
        cameras, capture.pulses_wanted, capture.pre_pulses, name_of(capture.end), capture.end_reason,
        settings);
    for (const CameraAccount& account : capture.accounts) {
      const auto keep = [&](const std::string& name, std::int64_t value) {
        impl_->sql.run(
            "INSERT INTO capture_counters(capture, camera, name, value) VALUES(?1, ?2, ?3, ?4) "
            "ON CONFLICT(capture, camera, name) DO UPDATE SET value = ?4",
            capture.id, account.camera, name, value);
      };
      keep("frames-in", account.frames_in);
      keep("delivered", account.delivered);
      for (const auto& [name, value] : account.counters) keep(name, value);
    }
    return {};
  });
}

Result<bool> Ledger::add_set(const FrameSet& set, const SpoolLocation& location, std::int64_t now_ns) {
  return guarded(impl_->database, [&]() -> Result<bool> {
    // A set may come before its capture was announced, e.g. when the spool is read after a crash.
    impl_->sql.run(
        "INSERT INTO captures(id, kind, started_time_ns) VALUES(?1, ?2, ?3) ON CONFLICT DO NOTHING",
        set.capture, name_of(set.kind), set.pulse_time_ns);
    const int added = impl_->sql.run(
        "INSERT INTO sets(capture, idx, pulse, pulse_time_ns, complete_time_ns, stored_time_ns, segment, "
        "byte_offset, byte_length, frames, losses) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11) "
        "ON CONFLICT(capture, idx) DO NOTHING",
        set.capture, set.index, set.pulse, set.pulse_time_ns, set.complete_time_ns, now_ns, location.segment,
        location.offset, location.length, set.frames.size(), set.losses.size());
    if (added == 0) return false;
    const std::int64_t id = impl_->database.getLastInsertRowid();
    constexpr const char* kFrame =
        "INSERT INTO frames(set_id, camera, loss) VALUES(?1, ?2, ?3) ON CONFLICT DO NOTHING";
    for (const Frame& frame : set.frames)
      impl_->sql.run(kFrame, id, frame.camera, std::optional<std::string_view>());
    for (const FrameLoss& loss : set.losses)
      impl_->sql.run(kFrame, id, loss.camera, std::optional<std::string_view>(name_of(loss.cause)));
    return true;
  });
}

Result<bool> Ledger::has_set(const SetId& id) {
  return guarded(impl_->database, [&]() -> Result<bool> {
    return impl_->integer("SELECT 1 FROM sets WHERE capture = ?1 AND idx = ?2", id.capture, id.index)
        .has_value();
  });
}

Result<SpoolLocation> Ledger::location_of(const SetId& id) {
  return guarded(impl_->database, [&]() -> Result<SpoolLocation> {
    auto& row =
        impl_->sql("SELECT segment, byte_offset, byte_length FROM sets WHERE capture = ?1 AND idx = ?2",
                   id.capture, id.index);
    if (!row.executeStep())
      return not_found(concat("set ", id.index, " of capture ", id.capture), "it is not in the ledger",
                       "see 'flamefield runs receipt'");
    const SpoolLocation location{row.getColumn(0).getUInt(),
                                 static_cast<std::uint64_t>(row.getColumn(1).getInt64()),
                                 static_cast<std::uint64_t>(row.getColumn(2).getInt64())};
    row.reset();
    return location;
  });
}

Result<std::vector<SetId>> Ledger::sets_of(const std::string& capture) {
  return guarded(impl_->database, [&]() -> Result<std::vector<SetId>> {
    std::vector<SetId> ids;
    auto& row = impl_->sql("SELECT idx FROM sets WHERE capture = ?1 ORDER BY idx", capture);
    while (row.executeStep()) ids.push_back({capture, row.getColumn(0).getInt64()});
    row.reset();
    return ids;
  });
}

Result<SpoolLocation> Ledger::last_location() {
  return guarded(impl_->database, [&]() -> Result<SpoolLocation> {
    SpoolLocation location;
    auto& row = impl_->sql(
        "SELECT segment, byte_offset, byte_length FROM sets ORDER BY segment DESC, byte_offset DESC LIMIT 1");
    if (row.executeStep())
      location = {row.getColumn(0).getUInt(), static_cast<std::uint64_t>(row.getColumn(1).getInt64()),
                  static_cast<std::uint64_t>(row.getColumn(2).getInt64())};
    row.reset();
    return location;
  });
}

}  // namespace flamefield
