// The disk that records, and the cameras.
#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <set>

#include "acquire/discovery.h"
#include "services/doctor/doctor.h"

namespace flamefield {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

namespace {

constexpr std::size_t kTrial_bytes = 64u << 20;
constexpr std::uint32_t kControlPrivilege = 0x0a00;

// Bytes a second with one fdatasync for each set's worth; 0: cannot write.
double write_speed(const fs::path& directory) {
  std::string name = (directory / "doctor-XXXXXX").string();
  const int fd = ::mkstemp(name.data());
  if (fd < 0) return 0;
  ::unlink(name.c_str());
  const std::vector<char> block(5u << 20, 'f');
  const auto begin = std::chrono::steady_clock::now();
  bool ok = true;
  for (std::size_t written = 0; ok && written < kTrial_bytes; written += block.size()) {
    ok =
        ::write(fd, block.data(), block.size()) == static_cast<ssize_t>(block.size()) && ::fdatasync(fd) == 0;
  }
  ::close(fd);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return ok ? static_cast<double>(kTrial_bytes) / seconds : 0;
}

std::string mb(double bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.0f MB", bytes * 1e-6);
  return text;
}

}  // namespace

std::vector<Finding> check_disk(const fs::path& directory, double bytes_per_s, bool writes) {
  fs::path place = fs::absolute(directory);
  while (!fs::exists(place) && place.has_relative_path()) place = place.parent_path();
  std::vector<Finding> out;
  struct statvfs info {};
  if (::statvfs(place.c_str(), &info) == 0) {
    const double free_bytes = static_cast<double>(info.f_bavail) * static_cast<double>(info.f_frsize);
    const double minutes = free_bytes / bytes_per_s / 60;
    char text[160];
    std::snprintf(text, sizeof text, "%.1f GB free: %.0f minutes at %.0f MB/s", 1e-9 * free_bytes, minutes,
                  1e-6 * bytes_per_s);
    const Health health = minutes < 10 ? Health::Bad : minutes < 60 ? Health::Doubtful : Health::Good;
    out.push_back({health, concat("room in ", place.string()), text,
                   health == Health::Good ? "" : "free space, or choose another data_directory"});
  }
  if (!writes) return out;
  const double speed = write_speed(place);
  Finding finding{Health::Good,
                  concat("speed of ", place.string()),
                  concat(mb(speed), "/s written and synchronised; the array makes ", mb(bytes_per_s), "/s"),
                  {}};
  if (speed < 2 * bytes_per_s) {
    finding.health = speed < bytes_per_s ? Health::Bad : Health::Doubtful;
    finding.fix = "record to a faster disk, or more slowly";
  }
  out.push_back(std::move(finding));
  return out;
}

std::vector<Finding> check_cameras(const std::vector<CameraAddress>& cameras) {
  std::vector<Finding> out;
  const auto resolved = resolve_addresses(cameras);  // two cameras at one address are found here
  if (!resolved) {
    out.push_back({Health::Bad, "cameras", resolved.error().message, {}});
    return out;
  }
  std::map<std::string, std::string> name_of_serial;
  for (const CameraAddress& camera : *resolved) {
    Finding finding{Health::Good, concat("camera ", camera.name), {}, {}};
    const auto found = discover_at(camera.address, milliseconds(600));
    if (!found) {
      finding = {Health::Bad, finding.subject, concat("no answer at ", camera.address),
                 "check its power, cable and address"};
      out.push_back(std::move(finding));
      continue;
    }
    finding.found = concat(found->model, ", serial number ", found->serial, ", at ", camera.address);
    if (!camera.serial.empty() && camera.serial != found->serial) {
      finding.health = Health::Bad;
      finding.fix = concat("number ", camera.serial, " is expected there: check whether cables were swapped");
    } else if (read_bootstrap_register(camera.address, kControlPrivilege, milliseconds(300)).value_or(0) !=
               0) {
      finding.health = Health::Doubtful;
      finding.found += ", controlled by a program";
      finding.fix = "if it is not this one, close it";
    }
    const auto [other, is_new] = name_of_serial.emplace(found->serial, camera.name);
    if (!is_new) {
      finding.health = Health::Bad;
      finding.fix = concat("it is the same camera as ", other->second, ": correct lab.toml");
    }
    out.push_back(std::move(finding));
  }
  std::map<std::string, std::set<std::string>> macs;
  for (const DiscoveredCamera& found : discover_all(milliseconds(500))) macs[found.address].insert(found.mac);
  for (const auto& [address, owners] : macs) {
    if (owners.size() < 2) continue;
    out.push_back({Health::Bad, concat("address ", address), concat(owners.size(), " devices use it"),
                   "give each its own, with arv-tool-0.8 or the maker's tool"});
  }
  return out;
}

}  // namespace flamefield
