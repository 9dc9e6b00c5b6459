#pragma once

#include <cstdint>

#include "reconstruct/evolutionary/brood.h"
#include "reconstruct/ranks.h"

namespace flamefield {

// Islands, one on each rank: broods on the same images with different random numbers. Every few generations
// they meet. What they have changed since is little and mostly elsewhere, so that they do not compete: all
// changes are added up, and all islands go on from the same field. Should the sum be worse than the best
// island, that one's changes alone count. Alone, nothing of this happens.
class Archipelago {
 public:
  Archipelago(Ranks* ranks, int generations);  // between meetings

  int islands() const { return ranks_ ? ranks_->count() : 1; }
  std::uint64_t seed(std::uint64_t first) const;
  bool meets(int generation) const { return !ranks_ || generation % generations_ == 0; }

  void settle(Brood& brood) const;   // a new one, which begins with the same field everywhere
  void migrate(Brood& brood) const;  // at a meeting
  bool agree(bool value) const;      // what the first island says

 private:
  Ranks* ranks_;  // null: alone
  int generations_;
};

}  // namespace flamefield
