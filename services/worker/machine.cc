#include "services/worker/machine.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <fstream>

namespace flamefield {

std::string host_name() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

std::int64_t memory_of_this_machine_mib() {
  const std::int64_t machine_mib =
      static_cast<std::int64_t>(::sysconf(_SC_PHYS_PAGES)) * ::sysconf(_SC_PAGESIZE) / (1 << 20);
  // cgroup v2, as a container sees it; "max" when there is no limit.
  std::ifstream file("/sys/fs/cgroup/memory.max");
  std::int64_t limit_bytes = 0;
  if (!(file >> limit_bytes) || limit_bytes <= 0) return machine_mib;
  return std::min(machine_mib, limit_bytes / (1 << 20));
}

void reset_peak_memory() {
  std::ofstream("/proc/self/clear_refs") << 5;  // proc(5)
}

double peak_memory_mib() {
  std::ifstream file("/proc/self/status");
  for (std::string word; file >> word;) {
    double kib = 0;
    if (word == "VmHWM:" && file >> kib) return kib / 1024;
  }
  return 0;
}

}  // namespace flamefield
