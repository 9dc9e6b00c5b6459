#pragma once

#include <string>
#include <string_view>

#include "reconstruct/evolutionary/ert.h"

namespace flamefield {

// What a checkpoint must have in common with the solve that goes on from it: images, grid, settings (but for
// the number of generations, which may be raised), seed and scale.
std::string checkpoint_identity(const Problem& problem, const ErtOptions& options, float scale);

inline constexpr std::string_view kOtherProblem = "it belongs to another problem or recipe";
inline constexpr std::string_view kDamaged = "it is damaged";
tl::unexpected<Error> checkpoint_refused(std::string_view why);

inline std::vector<float> scaled(std::vector<float> field, float factor) {
  for (float& v : field) v *= factor;
  return field;
}

// When to show the best field and to keep the state, as a SolveControl asks.
class Punctual {
 public:
  explicit Punctual(const SolveControl& control)
      : control_(control), next_checkpoint_s_(control.checkpoint_every_s) {}

  // best: () -> (nz, ny, nx) in physical units; state: () -> bytes. Called only when due.
  template <class Best, class State>
  void after_generation(double elapsed_s, const Grid& grid, Best best, State state) {
    if (control_.preview && elapsed_s >= next_preview_s_) {
      Volume volume(grid);
      volume.values = best();
      control_.preview(volume);
      next_preview_s_ = elapsed_s + control_.preview_every_s;
    }
    if (control_.checkpoint && elapsed_s >= next_checkpoint_s_) {
      control_.checkpoint(state());
      next_checkpoint_s_ = elapsed_s + control_.checkpoint_every_s;
    }
  }

 private:
  const SolveControl& control_;
  double next_preview_s_ = 0, next_checkpoint_s_;
};

}  // namespace flamefield
