#include "services/acquisition/account.h"

#include <string_view>
#include <utility>

namespace flamefield {

namespace {

using Counter = std::pair<std::string_view, std::int64_t CameraTally::*>;

constexpr Counter kUnusedFrames[] = {{"late", &CameraTally::late},
                                     {"duplicate", &CameraTally::duplicates},
                                     {"unwanted", &CameraTally::unwanted},
                                     {"before-start", &CameraTally::before_start},
                                     {"implausible", &CameraTally::implausible},
                                     {"extra", &CameraTally::extra}};
constexpr Counter kEvents[] = {{"failed-buffer", &CameraTally::unplaced},
                               {"count-slip", &CameraTally::count_slips}};

}  // namespace

std::vector<CameraReceipt> receipts_of(const CaptureProgress& progress,
                                       const std::vector<std::string>& names) {
  std::vector<CameraReceipt> out(names.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    out[i].camera = names[i];
    if (i < progress.tallies.size()) out[i].tally = progress.tallies[i];
    if (i < progress.rejoins.size()) out[i].rejoins = progress.rejoins[i];
  }
  return out;
}

std::map<std::string, std::string> settings_text(const CameraSettings& settings) {
  std::map<std::string, std::string> out;
  const auto note = [&](const char* name, const auto& value) { out[name] = concat(value); };
  note("trigger", settings.trigger_source);
  note("trigger_delay_us", settings.trigger_delay_us);
  note("exposure_us", settings.exposure_us);
  if (settings.gain_raw) note("gain_raw", *settings.gain_raw);
  if (settings.black_level_raw) note("black_level_raw", *settings.black_level_raw);
  note("pixel_format", name_of(settings.pixel_format));
  note("binning_x", settings.binning_x);
  note("binning_y", settings.binning_y);
  if (const auto& region = settings.region) {
    note("offset_x_px", region->offset_x_px);
    note("offset_y_px", region->offset_y_px);
    note("width_px", region->width_px);
    note("height_px", region->height_px);
  }
  note("packet_size_bytes", settings.packet_size_bytes);
  return out;
}

std::vector<CameraAccount> accounts_of(const CaptureState& state, const std::vector<CameraReceipt>& now,
                                       const std::vector<CameraReceipt>& before) {
  std::vector<CameraAccount> out;
  for (std::size_t i = 0; i < state.cameras.size() && i < now.size(); ++i) {
    const CaptureState::CameraState& camera = state.cameras[i];
    const CameraReceipt zero;
    const CameraReceipt& old = i < before.size() ? before[i] : zero;
    CameraAccount account{camera.name, camera.frames, camera.frames, camera.losses, {}};
    const auto note = [&](std::string_view name, std::int64_t count) {
      if (count > 0) account.counters[std::string(name)] = count;
    };
    for (const auto& [name, member] : kUnusedFrames) {
      const std::int64_t count = now[i].tally.*member - old.tally.*member;
      note(name, count);
      account.frames_in += count;
    }
    for (const auto& [name, member] : kEvents) note(name, now[i].tally.*member - old.tally.*member);
    note("rejoin", now[i].rejoins - old.rejoins);
    note("packet-resent", now[i].stream.resent_packets);
    note("underrun", now[i].stream.underruns);
    out.push_back(std::move(account));
  }
  return out;
}

}  // namespace flamefield
