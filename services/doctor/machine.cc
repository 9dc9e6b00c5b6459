// The network settings, processor and clock of this machine.
#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/timex.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <optional>

#include "services/doctor/doctor.h"

namespace flamefield {

namespace fs = std::filesystem;

namespace {

std::string text_in(const fs::path& file) {
  std::ifstream in(file);
  std::string text;
  std::getline(in, text);
  return text;
}

std::optional<std::int64_t> number_in(const fs::path& file) {
  std::ifstream in(file);
  std::int64_t value = 0;
  return in >> value ? std::optional(value) : std::nullopt;
}

std::vector<std::string> interfaces(const fs::path& root) {
  std::vector<std::string> out;
  std::error_code problem;
  for (const auto& entry : fs::directory_iterator(root / "sys/class/net", problem)) {
    const std::string name = entry.path().filename().string();
    if (name != "lo" && text_in(entry.path() / "operstate") != "down" && fs::exists(entry.path() / "mtu"))
      out.push_back(name);
  }
  std::sort(out.begin(), out.end());
  return out;
}

// Receive ring of a network card: now and at most; none: it has none that can be set.
std::optional<std::pair<unsigned, unsigned>> receive_ring(const std::string& interface) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return std::nullopt;
  ethtool_ringparam ring{};
  ring.cmd = ETHTOOL_GRINGPARAM;
  ifreq request{};
  std::snprintf(request.ifr_name, sizeof request.ifr_name, "%s", interface.c_str());
  request.ifr_data = reinterpret_cast<char*>(&ring);
  const bool ok = ::ioctl(fd, SIOCETHTOOL, &request) == 0;
  ::close(fd);
  if (!ok || ring.rx_max_pending == 0) return std::nullopt;
  return std::pair(ring.rx_pending, ring.rx_max_pending);
}

}  // namespace

Finding check_socket_buffers(const fs::path& root, const CameraSettings& settings) {
  const auto most = number_in(root / "proc/sys/net/core/rmem_max").value_or(0);
  Finding out{Health::Good, "socket buffers", concat("net.core.rmem_max is ", most >> 10, " KiB"), {}};
  if (most >= settings.socket_buffer_bytes) return out;
  out.health = most >= settings.socket_buffer_bytes / 4 ? Health::Doubtful : Health::Bad;
  out.fix = concat("sysctl -w net.core.rmem_max=", settings.socket_buffer_bytes,
                   "   (for good: deploy/sysctl/90-flamefield.conf into /etc/sysctl.d)");
  return out;
}

std::vector<Finding> check_reverse_path_filter(const fs::path& root) {
  const fs::path all = root / "proc/sys/net/ipv4/conf";
  const std::int64_t everywhere = number_in(all / "all/rp_filter").value_or(0);
  std::vector<Finding> out;
  for (const std::string& name : interfaces(root)) {
    const std::int64_t here = number_in(all / name / "rp_filter").value_or(0);
    if (std::max(everywhere, here) != 1) continue;
    out.push_back({Health::Doubtful, concat("reverse-path filter of ", name),
                   "strict: packets of cameras in another subnet are dropped without a word",
                   concat("sysctl -w net.ipv4.conf.all.rp_filter=2 net.ipv4.conf.", name, ".rp_filter=2")});
  }
  if (out.empty()) out.push_back({Health::Good, "reverse-path filter", "not strict", {}});
  return out;
}

std::vector<Finding> check_interfaces(const fs::path& root, int packet_size_bytes) {
  std::vector<Finding> out;
  for (const std::string& name : interfaces(root)) {
    const auto mtu = number_in(root / "sys/class/net" / name / "mtu").value_or(0);
    Finding finding{Health::Good, concat("interface ", name), concat("MTU ", mtu), {}};
    if (const auto speed = number_in(root / "sys/class/net" / name / "speed"); speed && *speed > 0) {
      finding.found += concat(", ", *speed, " Mbit/s");
      if (*speed < 1000) {
        finding.health = Health::Bad;
        finding.fix = "use a gigabit port and cable";
      }
    }
    if (mtu < packet_size_bytes) {
      finding.health = Health::Bad;
      finding.fix = concat("ip link set ", name, " mtu 9000, or packet_size_bytes = ", mtu, " in lab.toml");
    }
    if (const auto ring = root == "/" ? receive_ring(name) : std::nullopt) {
      finding.found += concat(", receive ring ", ring->first, " of ", ring->second);
      if (ring->first < ring->second && ring->first < 2048) {
        finding.health = std::max(finding.health, Health::Doubtful);
        finding.fix += concat(finding.fix.empty() ? "" : "; ", "ethtool -G ", name, " rx ", ring->second);
      }
    }
    out.push_back(std::move(finding));
  }
  if (out.empty())
    out.push_back({Health::Doubtful, "interfaces", "none but loopback is up", "connect the cameras"});
  return out;
}

Finding check_governor(const fs::path& root) {
  std::error_code problem;
  int slow = 0, all = 0;
  std::string name;
  for (const auto& entry : fs::directory_iterator(root / "sys/devices/system/cpu", problem)) {
    const fs::path file = entry.path() / "cpufreq/scaling_governor";
    if (!fs::exists(file)) continue;
    ++all;
    if (const std::string governor = text_in(file); governor != "performance") ++slow, name = governor;
  }
  if (all == 0) return {Health::Good, "processor clock", "is not governed here", {}};
  if (slow == 0) return {Health::Good, "processor clock", "governor performance", {}};
  return {Health::Doubtful, "processor clock",
          concat("governor ", name, " on ", slow, " of ", all,
                 " cores: the first packets after a pause find a slow one"),
          "cpupower frequency-set -g performance"};
}

Finding check_firewall() {
  Finding out{Health::Good, "firewall", "none found that would stop the cameras' packets", {}};
  const std::unique_ptr<FILE, int (*)(FILE*)> rules(::popen("nft list ruleset 2>/dev/null", "r"), &::pclose);
  if (!rules) return out;
  char line[512];
  bool is_input = false;
  while (std::fgets(line, sizeof line, rules.get())) {
    if (std::strstr(line, "hook input")) is_input = true;
    if (is_input && std::strstr(line, "policy drop")) {
      out.health = Health::Doubtful;
      out.found = "incoming packets are dropped unless a rule lets them in";
      out.fix =
          "nft add rule inet filter input iifname <camera interface> udp sport { 3956, 1024-65535 } accept";
    }
    if (std::strchr(line, '}')) is_input = false;
  }
  return out;
}

Finding check_clock() {
  timex clock{};
  const int state = ::adjtimex(&clock);
  if (state != TIME_ERROR && (clock.status & STA_UNSYNC) == 0) {
    return {Health::Good, "clock", "kept by a time server", {}};
  }
  return {Health::Doubtful, "clock", "not kept by any time server: times of pulses may be off",
          "timedatectl set-ntp true"};
}

}  // namespace flamefield
