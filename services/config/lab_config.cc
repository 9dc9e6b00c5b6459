#include "services/config/lab_config.h"

#include <cmath>
#include <concepts>
#include <numbers>
#include <optional>
#include <set>

#include "services/config/suggestion.h"
#include "services/config/toml_file.h"

namespace flamefield {

namespace {

// Takes typed values out of a file and remembers which keys it knows. The first fault stays.
class KeyReader {
 public:
  explicit KeyReader(const TomlFile& file) : file_(file) {}

  void take(const std::string& key, std::string& out) {
    const TomlEntry* entry = single(key);
    if (!entry) return;
    if (const auto* text = std::get_if<std::string>(&entry->values[0])) {
      out = *text;
    } else {
      refuse(key, "not a text", "put it between quotation marks");
    }
  }
  void take(const std::string& key, std::filesystem::path& out) {
    std::string text;
    take(key, text);
    if (!text.empty()) out = file_.path.parent_path() / text;
  }
  void take(const std::string& key, double& out, double low, double high) {
    if (const TomlEntry* entry = single(key)) out = number(key, entry->values[0], low, high, false);
  }
  template <std::integral T>
  void take(const std::string& key, T& out, double low, double high) {
    if (const TomlEntry* entry = single(key))
      out = static_cast<T>(number(key, entry->values[0], low, high, true));
  }
  // A list of texts.
  void take(const std::string& key, std::vector<std::string>& out) {
    known_.insert(key);
    const auto found = file_.entries.find(key);
    if (found == file_.entries.end()) return;
    out.clear();
    for (const Setting& value : found->second.values) {
      const auto* text = std::get_if<std::string>(&value);
      if (!text || !found->second.is_list)
        return refuse(key, "not a list of texts", "e.g. [\"--exclusive\"]");
      out.push_back(*text);
    }
  }
  // A list of three.
  std::optional<Eigen::Vector3d> take_triple(const std::string& key, double low, double high, bool is_whole) {
    known_.insert(key);
    const auto found = file_.entries.find(key);
    if (found == file_.entries.end()) return std::nullopt;
    if (!found->second.is_list || found->second.values.size() != 3) {
      refuse(key, "not a list of three numbers", "e.g. [52, 55, 52]");
      return std::nullopt;
    }
    Eigen::Vector3d triple;
    for (Eigen::Index i = 0; i < 3; ++i)
      triple[i] = number(key, found->second.values[static_cast<std::size_t>(i)], low, high, is_whole);
    return triple;
  }
  void refuse(const std::string& key, std::string_view why, std::string_view suggestion) {
    if (!fault_) fault_ = file_.fault(key, concat("'", key, "'"), why, suggestion).value();
  }
  Result<> finish() const {
    if (fault_) return tl::unexpected(*fault_);
    for (const auto& [key, entry] : file_.entries) {
      if (known_.count(key)) continue;
      const std::vector<std::string_view> names(known_.begin(), known_.end());
      return file_.fault(key, concat("unknown key '", key, "'"), "no part of the program reads it",
                         suggest(key, names));
    }
    return {};
  }

 private:
  const TomlEntry* single(const std::string& key) {
    known_.insert(key);
    const auto found = file_.entries.find(key);
    if (found == file_.entries.end()) return nullptr;
    if (!found->second.is_list) return &found->second;
    refuse(key, "a list", "write one value");
    return nullptr;
  }
  double number(const std::string& key, const Setting& setting, double low, double high, bool is_whole) {
    const auto* integer = std::get_if<std::int64_t>(&setting);
    const auto* real = std::get_if<double>(&setting);
    if (!integer && (is_whole || !real)) {
      refuse(key, is_whole ? "not a whole number" : "not a number", "write a number without quotation marks");
      return low;
    }
    const double value = integer ? static_cast<double>(*integer) : *real;
    if (!(value >= low && value <= high))
      refuse(key, concat(value, " is outside [", low, ", ", high, "]"), "choose a value within");
    return value;
  }

  const TomlFile& file_;
  std::set<std::string> known_;
  std::optional<Error> fault_;
};

void read_cameras(const TomlFile& file, KeyReader& keys, LabConfig& lab) {
  std::set<std::string> names;
  for (std::size_t i = 0; file.entries.count(concat("camera[", i, "].name")) ||
                          file.entries.count(concat("camera[", i, "].address")) ||
                          file.entries.count(concat("camera[", i, "].serial"));
       ++i) {
    LabCamera camera;
    const std::string name = concat("camera[", i, "].name"), address = concat("camera[", i, "].address");
    keys.take(name, camera.name);
    keys.take(address, camera.address);
    keys.take(concat("camera[", i, "].serial"), camera.serial);
    if (camera.name.empty()) keys.refuse(address, "the camera has no name", "add name = \"cam00\"");
    if (camera.address.empty() && camera.serial.empty())
      keys.refuse(name, "the camera has no address",
                  "add address = \"192.168.7.10\", or serial = \"21000000\" to look for it");
    if (!names.insert(camera.name).second) keys.refuse(name, "the name appears twice", "rename one camera");
    lab.cameras.push_back(camera);
  }
}

void read_capture(KeyReader& keys, LabConfig& lab) {
  keys.take("trigger.rate_hz", lab.trigger_rate_hz, 1e-3, 1000);
  keys.take("trigger.source", lab.trigger_source);
  if (lab.trigger_source != "line" && lab.trigger_source != "action")
    keys.refuse("trigger.source", concat("'", lab.trigger_source, "' is unknown"),
                suggest(lab.trigger_source, {"line", "action"}));
  keys.take("trigger.line", lab.trigger_line);
  keys.take("trigger.action_device_key", lab.action_device_key, 0, 4294967295.0);
  keys.take("trigger.action_group_key", lab.action_group_key, 0, 4294967295.0);
  keys.take("trigger.action_group_mask", lab.action_group_mask, 1, 4294967295.0);
  keys.take("trigger.action_broadcast", lab.action_broadcast);
  keys.take("capture.exposure_us", lab.exposure_us, 1, 1e7);
  keys.take("capture.gain_db", lab.gain_db, 0, 48);
  keys.take("capture.trigger_delay_us", lab.trigger_delay_us, 0, 1e6);
  keys.take("capture.black_level_raw", lab.black_level_raw, 0, 1e5);
  keys.take("capture.binning_x", lab.binning_x, 1, 4);
  keys.take("capture.binning_y", lab.binning_y, 1, 4);
  keys.take("capture.offset_x_px", lab.offset_x_px, 0, 65535);
  keys.take("capture.offset_y_px", lab.offset_y_px, 0, 65535);
  keys.take("capture.width_px", lab.width_px, 0, 65535);
  keys.take("capture.height_px", lab.height_px, 0, 65535);
  if ((lab.width_px > 0) != (lab.height_px > 0)) {
    keys.refuse(lab.width_px > 0 ? "capture.width_px" : "capture.height_px",
                "a region has a width and a height", "give both, or neither for the whole sensor");
  }
  if (lab.width_px == 0 && (lab.offset_x_px > 0 || lab.offset_y_px > 0))
    keys.refuse(lab.offset_x_px > 0 ? "capture.offset_x_px" : "capture.offset_y_px",
                "an offset without a size moves nothing", "give width_px and height_px too");
  keys.take("capture.history_pulses", lab.history_pulses, 0, 1e5);
  keys.take("capture.history_mib", lab.history_mib, 1, 1e6);
  keys.take("network.packet_size_bytes", lab.packet_size_bytes, 220, 16404);
  keys.take("network.link_mbit_per_s", lab.link_mbit_per_s, 10, 4e5);
  keys.take("network.switch_buffer_kib", lab.switch_buffer_kib, 0, 1e6);
  std::string format(name_of(lab.pixel_format));
  keys.take("capture.pixel_format", format);
  if (const auto known = pixel_format_from_name(format)) {
    lab.pixel_format = *known;
  } else {
    keys.refuse("capture.pixel_format", concat("'", format, "' is unknown"),
                suggest(format, {"Mono8", "Mono12", "Mono12Packed", "Mono16"}));
  }
  keys.take("simulator.cameras", lab.simulated_cameras, 1, 64);
  keys.take("simulator.seed", lab.simulator_seed, 0, 9e15);
  keys.take("simulator.flame", lab.simulated_flame);
}

void read_calibration(KeyReader& keys, LabConfig& lab) {
  std::string size = concat(lab.board.cols, 'x', lab.board.rows), kind(name_of(lab.board.kind));
  keys.take("calibration.board", size);
  keys.take("calibration.square_mm", lab.board.square_mm, 1e-3, 1e4);
  keys.take("calibration.board_type", kind);
  keys.take("calibration.marker_mm", lab.board.marker_mm, 0, 1e4);
  keys.take("calibration.dictionary", lab.board.dictionary);
  const auto numbers = board_from_text(size, lab.board.square_mm);
  if (numbers) {
    lab.board.cols = numbers->cols;
    lab.board.rows = numbers->rows;
  } else {
    keys.refuse("calibration.board", numbers.error().message, "");
  }
  if (const auto known = board_kind_from_name(kind)) {
    lab.board.kind = *known;
  } else {
    keys.refuse("calibration.board_type", concat("'", kind, "' is unknown"),
                suggest(kind, {"checkerboard", "charuco"}));
  }
  if (auto ok = validate(lab.board); !ok) keys.refuse("calibration.board_type", ok.error().message, "");
  if (const auto centre = keys.take_triple("calibration.reference_centre_mm", -1e6, 1e6, false))
    lab.reference_centre_mm = *centre;
  double azimuth_deg = 0;
  keys.take("calibration.reference_azimuth_deg", azimuth_deg, -360, 360);
  lab.reference_azimuth_rad = azimuth_deg * std::numbers::pi / 180;
  if (const auto centre = keys.take_triple("calibration.volume_centre_mm", -1e6, 1e6, false))
    lab.volume_centre_mm = *centre;
  keys.take("calibration.volume_diameter_mm", lab.volume_diameter_mm, 1e-3, 1e4);
  keys.take("calibration.volume_height_mm", lab.volume_height_mm, 1e-3, 1e4);
}

void read_reconstruction(KeyReader& keys, LabConfig& lab) {
  keys.take("reconstruction.rig", lab.rig);
  keys.take("reconstruction.recipe", lab.recipe);
  keys.take("reconstruction.workers", lab.workers, 0, 256);
  keys.take("reconstruction.threads", lab.threads_per_worker, 0, 1024);
  const auto size = keys.take_triple("reconstruction.size", 1, 4096, true);
  double spacing_mm = lab.domain.spacing_mm[0];
  keys.take("reconstruction.spacing_mm", spacing_mm, 1e-6, 1e6);
  const Eigen::Vector3d n = size.value_or(Eigen::Vector3d(lab.domain.nx, lab.domain.ny, lab.domain.nz));
  lab.domain =
      centred_grid(static_cast<int>(n[0]), static_cast<int>(n[1]), static_cast<int>(n[2]), spacing_mm);
  if (const auto origin = keys.take_triple("reconstruction.origin_mm", -1e6, 1e6, false))
    lab.domain.origin_mm = *origin;
}

void read_cluster(KeyReader& keys, ClusterConfig& cluster) {
  keys.take("cluster.endpoint", cluster.endpoint);
  keys.take("cluster.directory", cluster.directory);
  keys.take("cluster.worker", cluster.worker);
  keys.take("cluster.partition", cluster.partition);
  keys.take("cluster.live_partition", cluster.live_partition);
  keys.take("cluster.account", cluster.account);
  keys.take("cluster.constraint", cluster.constraint);
  keys.take("cluster.sbatch", cluster.sbatch);
  keys.take("cluster.setup", cluster.setup);
  keys.take("cluster.pilots", cluster.pilots, 1, 20'000);
  keys.take("cluster.cores", cluster.cores, 1, 4096);
  keys.take("cluster.memory_mib", cluster.memory_mib, 0, 1e8);
  keys.take("cluster.minutes", cluster.minutes, 0, 1e5);
  keys.take("cluster.most_minutes", cluster.most_minutes, 1, 1e5);
  keys.take("cluster.idle_s", cluster.idle_s, 1, 1e6);
  keys.take("cluster.drain_s", cluster.drain_s, 1, 65'535);
  keys.take("cluster.silence_s", cluster.silence_s, 1, 1e6);
  keys.take("cluster.key_days", cluster.key_days, 1, 3650);
}

}  // namespace

Result<LabConfig> read_lab_config(const std::filesystem::path& path) {
  auto file = read_toml(path);
  if (!file) return tl::unexpected(file.error());
  LabConfig lab;
  KeyReader keys(*file);
  keys.take("laboratory", lab.laboratory);
  keys.take("data_directory", lab.data_directory);
  read_cameras(*file, keys, lab);
  read_capture(keys, lab);
  read_calibration(keys, lab);
  keys.take("web.host", lab.http_host);
  keys.take("web.port", lab.http_port, 0, 65535);
  keys.take("web.public_name", lab.http_public_name);
  keys.take("bus.dispatcher", lab.dispatcher_endpoint);
  keys.take("bus.events", lab.events_endpoint);
  keys.take("bus.acquisition", lab.acquisition_endpoint);
  keys.take("bus.keys", lab.keys_directory);
  read_reconstruction(keys, lab);
  read_cluster(keys, lab.cluster);
  if (auto ok = keys.finish(); !ok) return tl::unexpected(ok.error());
  return lab;
}

}  // namespace flamefield
