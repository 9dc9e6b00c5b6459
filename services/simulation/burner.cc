#include "services/simulation/burner.h"

#include <optional>
#include <tuple>
#include <utility>

namespace flamefield {

SimulatedBurner::SimulatedBurner(Options options) : options_(std::move(options)) {}

void SimulatedBurner::light(std::shared_ptr<const FlameFilm> film) {
  const std::scoped_lock lock(mutex_);
  film_ = std::move(film);
}

void SimulatedBurner::show(CaptureKind kind) {
  const std::scoped_lock lock(mutex_);
  showing_ = kind;
}

void SimulatedBurner::hold_board(bool on) {
  const std::scoped_lock lock(mutex_);
  holds_ = on;
  held_pose_ = 0;
}

void SimulatedBurner::turn_board() {
  const std::scoped_lock lock(mutex_);
  held_pose_ = (held_pose_ + 1) % options_.world_from_board.size();
}

std::shared_ptr<const Image> SimulatedBurner::even_light(std::size_t camera, double electrons) const {
  const Camera& c = options_.true_rig.cameras[camera];
  return std::make_shared<const Image>(c.image_width_px, c.image_height_px, static_cast<float>(electrons));
}

std::shared_ptr<const Image> SimulatedBurner::picture(std::size_t camera, const Pulse& pulse) const {
  const auto [showing, film, held] = [&] {
    const std::scoped_lock lock(mutex_);
    return std::tuple(showing_, film_, holds_ ? std::optional(held_pose_) : std::nullopt);
  }();
  switch (showing) {
    case CaptureKind::Dark:
      return nullptr;
    case CaptureKind::Background:
      return even_light(camera, options_.room_electrons);
    case CaptureKind::Flat:
      return even_light(camera, options_.flat_electrons);
    case CaptureKind::Board: {
      const auto pose =
          held.value_or(static_cast<std::size_t>(pulse.index) % options_.world_from_board.size());
      return std::make_shared<const Image>(
          render_board(options_.true_rig.cameras[camera], options_.world_from_board[pose], options_.board));
    }
    case CaptureKind::Burst:
    case CaptureKind::Live:
      break;
  }
  if (!film) return even_light(camera, options_.room_electrons);
  auto picture = film->picture(camera, pulse.index);
  for (float& electrons : picture->pixels) electrons += static_cast<float>(options_.room_electrons);
  return picture;
}

}  // namespace flamefield
