#include "services/cluster/pilot_size.h"

#include <algorithm>
#include <cmath>

namespace flamefield {

namespace {

constexpr double kWorthAPilot_s = 60;  // less work than this does not pay for one more start
constexpr double kMemoryMargin = 1.25, kTimeMargin = 1.5;
constexpr std::int64_t kWorkerItself_mib = 256;
constexpr std::int64_t kUnknownMemory_mib = 4096;
constexpr int kUnknownMinutes = 60, kLeastMinutes = 5;

}  // namespace

PilotSize size_pilots(const PilotWork& work, const ClusterConfig& config) {
  PilotSize size;
  const std::int64_t useful =
      work.seconds > 0 ? static_cast<std::int64_t>(std::ceil(work.seconds / kWorthAPilot_s)) : work.volumes;
  const std::int64_t most = std::max<std::int64_t>(1, std::min(work.volumes, useful));
  size.pilots = static_cast<int>(std::min<std::int64_t>(config.pilots, most));
  size.cores = config.cores;
  size.memory_mib = config.memory_mib;
  if (size.memory_mib == 0)
    size.memory_mib = work.peak_rss_mib > 0
                          ? std::llround(kMemoryMargin * work.peak_rss_mib) + kWorkerItself_mib
                          : kUnknownMemory_mib;
  const double each_s = work.seconds / size.pilots;
  const double ends_s = config.drain_s + config.idle_s;
  size.minutes = config.minutes;
  if (size.minutes == 0) {
    const int needed = work.seconds > 0 ? static_cast<int>(std::ceil((kTimeMargin * each_s + ends_s) / 60))
                                        : kUnknownMinutes + static_cast<int>(ends_s) / 60;
    size.minutes = std::min(std::max(kLeastMinutes, needed), config.most_minutes);
  }
  const double usable_s = std::max(0.0, 60.0 * size.minutes - config.drain_s);
  size.seconds_left = std::max(0.0, work.seconds - size.pilots * usable_s);
  return size;
}

}  // namespace flamefield
