#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "acquire/bandwidth_plan.h"
#include "acquire/settings.h"

namespace flamefield {

enum class Health { Good, Doubtful, Bad };
std::string_view name_of(Health health);

// One thing that was looked at, what was found, and what a user types to put it right.
struct Finding {
  Health health = Health::Good;
  std::string subject;
  std::string found;
  std::string fix;  // empty: nothing to do
};

struct DoctorOptions {
  std::vector<CameraAddress> cameras;
  CameraSettings settings;
  BandwidthNeeds bandwidth;
  std::filesystem::path data_directory = "flamefield-data";
  std::filesystem::path root = "/";  // where proc/ and sys/ are
  bool asks_cameras = true;
  bool writes_to_disk = true;  // some seconds
};

// Everything that has made captures lose frames. Never changes the machine.
std::vector<Finding> examine(const DoctorOptions& options);

// The parts.
Finding check_socket_buffers(const std::filesystem::path& root, const CameraSettings& settings);
std::vector<Finding> check_reverse_path_filter(const std::filesystem::path& root);
std::vector<Finding> check_interfaces(const std::filesystem::path& root, int packet_size_bytes);
Finding check_governor(const std::filesystem::path& root);
Finding check_firewall();
Finding check_clock();
Finding check_bandwidth(const BandwidthNeeds& needs);
std::vector<Finding> check_disk(const std::filesystem::path& directory, double bytes_per_s, bool writes);
std::vector<Finding> check_cameras(const std::vector<CameraAddress>& cameras);

}  // namespace flamefield
