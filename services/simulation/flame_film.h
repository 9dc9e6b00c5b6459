#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <vector>

#include "proto/image.h"
#include "proto/rig.h"
#include "proto/volume.h"
#include "reconstruct/phantom/phantom.h"

namespace flamefield {

struct FlameFilmOptions {
  Grid grid;  // of the reconstruction; truths are kept on it
  PhantomKind kind = PhantomKind::Stratified;
  std::uint64_t seed = 1;
  int frames = 30;
  double frame_interval_s = 0.2;  // between pulses
  int refinement = 3;             // the flame is made and rendered this many times finer than `grid`
  double peak_electrons = 1600;   // photo-electrons at the brightest pixel of the film
  std::optional<Volume> field;    // show this one instead of a phantom, the same at every pulse
};

// What the cameras of a known rig see of a flame, pulse by pulse, and the fields behind it.
class FlameFilm {
 public:
  using Progress = std::function<void(int done, int total)>;

  // Renders all views of all frames. The rays cross a field finer than the reconstruction's, one for each
  // pixel of the sensor, which is itself finer than what is reconstructed from; so no later result rests on
  // an inverse crime. Unavailable when stopped.
  static Result<FlameFilm> render(const FlameFilmOptions& options, const Rig& rig, const Progress& progress,
                                  std::stop_token stop);

  int frames() const { return static_cast<int>(truths_.size()); }
  // Photo-electrons on the whole sensor of a camera of the rig.
  std::shared_ptr<Image> picture(std::size_t camera, std::int64_t frame) const;
  // The field behind a frame on the reconstruction's grid, in [0, 1].
  const Volume& truth(int frame) const { return truths_[static_cast<std::size_t>(frame)]; }
  Volume mean_truth() const;
  // Photo-electrons per (field unit x mm).
  double electrons_per_unit() const { return electrons_per_unit_; }

 private:
  struct Patch {  // the part of a sensor that sees the flame's box
    int x0_px = 0, y0_px = 0;
    Image image;
  };
  Rig rig_;
  std::vector<std::vector<Patch>> patches_;  // (frame, camera)
  std::vector<Volume> truths_;
  double electrons_per_unit_ = 1;
};

}  // namespace flamefield
