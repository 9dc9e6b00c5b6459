#include "services/api/machine_figures.h"

#include <sys/resource.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <system_error>

namespace flamefield {

namespace fs = std::filesystem;

MachineFigures machine_figures(const fs::path& data_dir) {
  MachineFigures figures;
  std::error_code problem;
  if (const fs::space_info space = fs::space(data_dir, problem); !problem) {
    figures.disk_free_bytes = static_cast<std::int64_t>(space.available);
    figures.disk_bytes = static_cast<std::int64_t>(space.capacity);
  }
  for (const auto& entry : fs::directory_iterator(data_dir / "spool", problem)) {
    const auto bytes = entry.file_size(problem);
    if (!problem) figures.spool_bytes += static_cast<std::int64_t>(bytes);
  }
  std::int64_t pages = 0, resident_pages = 0;
  std::ifstream("/proc/self/statm") >> pages >> resident_pages;
  figures.resident_bytes = resident_pages * ::sysconf(_SC_PAGESIZE);
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  figures.cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  const fs::directory_iterator files("/proc/self/fd", problem);
  if (!problem) figures.open_files = std::distance(begin(files), end(files));
  return figures;
}

}  // namespace flamefield
