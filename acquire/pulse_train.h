#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>

namespace flamefield {

// When the latest pulses were, on the array's common time, and how many cameras agree on each.
class PulseTrain {
 public:
  struct Entry {
    std::int64_t time_ns = 0;
    std::size_t votes = 0;  // cameras whose clocks are trusted and that agree
  };

  void note(std::int64_t pulse, const Entry& entry);
  void forget(std::int64_t pulse) { entries_.erase(pulse); }
  // One number less for every pulse after this one, which was none.
  void close_gap(std::int64_t pulse);

  std::optional<Entry> at(std::int64_t pulse) const;
  // The pulse at most half_width_ns from a time that most, and at least `votes`, cameras agree on; the
  // nearest of equals.
  std::optional<std::int64_t> pulse_at(std::int64_t time_ns, std::size_t votes = 0) const;
  // Whether no two known pulses are so near to this time that it could mean either.
  bool is_unambiguous(std::int64_t time_ns) const;
  std::optional<std::pair<std::int64_t, Entry>> newest() const;
  // The last pulse before this time.
  std::optional<std::int64_t> before(std::int64_t time_ns) const;

  // Two times of one pulse differ by less than this: a quarter of the shortest spacing, at most 20 ms.
  std::int64_t half_width_ns() const { return half_width_ns_; }
  // Median distance between neighbours; none: too few, or they are not alike (no regular train).
  std::optional<std::int64_t> period_ns() const { return period_ns_; }

 private:
  void measure();

  std::map<std::int64_t, Entry> entries_;  // times rise with the number
  std::int64_t half_width_ns_ = 5'000'000;
  std::optional<std::int64_t> period_ns_;
};

}  // namespace flamefield
