#include "services/doctor/doctor.h"

#include "proto/frame.h"

namespace flamefield {

std::string_view name_of(Health health) {
  switch (health) {
    case Health::Good:
      return "good";
    case Health::Doubtful:
      return "doubtful";
    case Health::Bad:
      return "bad";
  }
  return "unknown";
}

std::vector<Finding> examine(const DoctorOptions& options) {
  std::vector<Finding> out;
  const auto add = [&out](std::vector<Finding> more) { out.insert(out.end(), more.begin(), more.end()); };
  out.push_back(check_bandwidth(options.bandwidth));
  out.push_back(check_socket_buffers(options.root, options.settings));
  add(check_interfaces(options.root, options.settings.packet_size_bytes));
  add(check_reverse_path_filter(options.root));
  out.push_back(check_firewall());
  out.push_back(check_governor(options.root));
  out.push_back(check_clock());
  const BandwidthNeeds& needs = options.bandwidth;
  const double bytes_per_s =
      static_cast<double>(needs.cameras) * needs.rate_hz *
      static_cast<double>(bytes_of_image(needs.format, needs.width_px, needs.height_px));
  add(check_disk(options.data_directory, bytes_per_s, options.writes_to_disk));
  if (options.asks_cameras) add(check_cameras(options.cameras));
  return out;
}

Finding check_bandwidth(const BandwidthNeeds& needs) {
  Finding out{Health::Good, "bandwidth plan", {}, {}};
  const auto plan = plan_bandwidth(needs);
  if (!plan) {
    out.health = Health::Bad;
    out.found = plan.error().message;
    return out;
  }
  char text[200];
  std::snprintf(text, sizeof text,
                "%zu frames of %s, %dx%d px, take %.1f ms of the %.1f ms between pulses; %zu cameras send at "
                "once; up to %.1f Hz",
                needs.cameras, std::string(name_of(needs.format)).c_str(), needs.width_px, needs.height_px,
                plan->burst_ms, plan->period_ms, plan->at_once, plan->most_rate_hz);
  out.found = text;
  for (const std::string& warning : plan->warnings) {
    out.health = Health::Doubtful;
    out.fix += out.fix.empty() ? warning : "; " + warning;
  }
  return out;
}

}  // namespace flamefield
