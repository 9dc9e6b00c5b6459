#include "acquire/simulator/transmission.h"

#include <algorithm>
#include <random>

namespace flamefield {

namespace {

constexpr std::uint32_t kDropEvery = 16;       // packets
constexpr std::ptrdiff_t kReorderWithin = 16;  // packets

std::uint64_t hash(std::uint64_t x) {
  x = (x ^ (x >> 31)) * 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 29)) * 0xbf58476d1ce4e5b9ull;
  return x ^ (x >> 32);
}

bool is_cut(const std::vector<PulseRange>& cuts, std::int64_t pulse) {
  return std::any_of(cuts.begin(), cuts.end(), [&](const PulseRange& cut) { return cut.contains(pulse); });
}

}  // namespace

bool Transmission::is_lost(const StreamFrame& frame, std::uint32_t packet, std::uint64_t attempt) const {
  if (faults_.lost_frames.contains(frame.pulse) || is_cut(faults_.link_cuts, frame.pulse)) return true;
  if (packet == 0 && faults_.lost_leaders.contains(frame.pulse)) return true;
  if (packet == frame.packets() - 1 && faults_.lost_trailers.contains(frame.pulse)) return true;
  if (attempt == 0 && packet % kDropEvery == 1 && faults_.dropped_packets.contains(frame.pulse)) return true;
  if (faults_.packet_loss <= 0) return false;
  const std::uint64_t bits =
      hash(hash(hash(hash(seed_) + static_cast<std::uint64_t>(frame.pulse)) + packet) + attempt);
  return static_cast<double>(bits >> 11) * 0x1p-53 < faults_.packet_loss;
}

std::vector<std::uint32_t> Transmission::sequence(const StreamFrame& frame) const {
  const bool is_doubled = faults_.duplicated.contains(frame.pulse);
  std::vector<std::uint32_t> out;
  out.reserve(frame.packets() * (is_doubled ? 2 : 1));
  for (std::uint32_t packet = 0; packet < frame.packets(); ++packet) {
    if (is_lost(frame, packet, 0)) continue;
    out.push_back(packet);
    if (is_doubled) out.push_back(packet);
  }
  if (faults_.reordered.contains(frame.pulse)) {
    std::mt19937_64 random(hash(seed_) + static_cast<std::uint64_t>(frame.pulse));
    for (auto block = out.begin(); block != out.end();) {
      const auto end = block + std::min<std::ptrdiff_t>(kReorderWithin, out.end() - block);
      std::shuffle(block, end, random);
      block = end;
    }
  }
  return out;
}

}  // namespace flamefield
