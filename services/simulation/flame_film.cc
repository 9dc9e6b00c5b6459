#include "services/simulation/flame_film.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/metrics.h"
#include "reconstruct/render.h"

namespace flamefield {

namespace {

Grid refined(const Grid& grid, int factor) {
  Grid fine = grid;
  fine.nx *= factor;
  fine.ny *= factor;
  fine.nz *= factor;
  fine.spacing_mm /= factor;
  fine.origin_mm = grid.lower_mm() + 0.5 * fine.spacing_mm;
  return fine;
}

struct Window {
  int x0_px, y0_px, width_px, height_px;
};

// The sensor region onto which the box projects; nothing lights up outside it.
Window window_of(const Camera& camera, const Grid& grid) {
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d pick(corner & 1, (corner >> 1) & 1, corner >> 2);
    const Eigen::Vector3d size = grid.upper_mm() - grid.lower_mm();
    if (const auto pixel = project(camera, grid.lower_mm() + pick.cwiseProduct(size))) {
      low = low.cwiseMin(*pixel);
      high = high.cwiseMax(*pixel);
    }
  }
  const int x0 = std::clamp(static_cast<int>(std::floor(low.x())), 0, camera.image_width_px - 1);
  const int y0 = std::clamp(static_cast<int>(std::floor(low.y())), 0, camera.image_height_px - 1);
  const int x1 = std::clamp(static_cast<int>(std::ceil(high.x())), x0, camera.image_width_px - 1);
  const int y1 = std::clamp(static_cast<int>(std::ceil(high.y())), y0, camera.image_height_px - 1);
  return {x0, y0, x1 - x0 + 1, y1 - y0 + 1};
}

}  // namespace

Result<FlameFilm> FlameFilm::render(const FlameFilmOptions& options, const Rig& rig, const Progress& progress,
                                    std::stop_token stop) {
  FlameFilm film;
  film.rig_ = rig;
  const int distinct = options.field || !evolves(options.kind) ? 1 : options.frames;
  const int total = distinct * static_cast<int>(rig.cameras.size());
  float brightest = 0;
  int done = 0;
  for (int frame = 0; frame < distinct; ++frame) {
    const Volume field = options.field
                             ? *options.field
                             : make_phantom({options.kind, options.seed, frame * options.frame_interval_s},
                                            refined(options.grid, options.refinement));
    film.truths_.push_back(resample(field, options.grid));
    const Renderer renderer(field);
    std::vector<Patch> patches;
    for (const Camera& camera : rig.cameras) {
      if (stop.stop_requested()) return unavailable("rendering the flame", "stopped", "run it again");
      const Window w = window_of(camera, field.grid);
      const Camera part = cropped_and_binned(camera, w.x0_px, w.y0_px, w.width_px, w.height_px, 1);
      Patch patch{w.x0_px, w.y0_px, renderer.view(part, {})};
      brightest = std::max(brightest, std::ranges::max(patch.image.pixels));
      patches.push_back(std::move(patch));
      progress(++done, total);
    }
    film.patches_.push_back(std::move(patches));
  }
  if (!(brightest > 0)) {
    return invalid_input("the flame is dark in every view", "nothing would be reconstructed",
                         "check the field and --spacing-mm");
  }
  film.electrons_per_unit_ = options.peak_electrons / brightest;
  for (auto& patches : film.patches_) {
    for (Patch& patch : patches) {
      for (float& value : patch.image.pixels) value *= static_cast<float>(film.electrons_per_unit_);
    }
  }
  while (film.frames() < options.frames) film.truths_.push_back(film.truths_.front());
  return film;
}

std::shared_ptr<Image> FlameFilm::picture(std::size_t camera, std::int64_t frame) const {
  const auto index = static_cast<std::size_t>(frame) % patches_.size();
  const Patch& patch = patches_[index][camera];
  auto sensor =
      std::make_shared<Image>(rig_.cameras[camera].image_width_px, rig_.cameras[camera].image_height_px);
  for (int y = 0; y < patch.image.height_px; ++y) {
    const auto row = patch.image.pixels.begin() + static_cast<std::ptrdiff_t>(y) * patch.image.width_px;
    std::copy_n(row, patch.image.width_px, &sensor->at(patch.x0_px, patch.y0_px + y));
  }
  return sensor;
}

Volume FlameFilm::mean_truth() const {
  Volume mean(truths_.front().grid);
  const auto weight = 1.0f / static_cast<float>(truths_.size());
  for (const Volume& truth : truths_) {
    for (std::size_t i = 0; i < mean.values.size(); ++i) mean.values[i] += weight * truth.values[i];
  }
  return mean;
}

}  // namespace flamefield
