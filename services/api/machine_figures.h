#pragma once

#include <cstdint>
#include <filesystem>

namespace flamefield {

// Of this process and of the disk under a directory; 0 where the system does not say.
struct MachineFigures {
  std::int64_t disk_free_bytes = 0, disk_bytes = 0;
  std::int64_t spool_bytes = 0;
  std::int64_t resident_bytes = 0;
  double cpu_s = 0;
  std::int64_t open_files = 0;
};
MachineFigures machine_figures(const std::filesystem::path& data_dir);

}  // namespace flamefield
