#pragma once

#include <memory>
#include <mutex>
#include <string_view>
#include <vector>

#include "acquire/simulator/board_scene.h"
#include "acquire/simulator/scene.h"
#include "proto/frame.h"
#include "proto/rig.h"
#include "services/simulation/flame_film.h"

namespace flamefield {

// The laboratory in front of the simulated cameras: a board that someone turns, a burner, a room, lens caps.
class SimulatedBurner {
 public:
  struct Options {
    Rig true_rig;  // where the cameras really stand
    BoardScene board;
    std::vector<Rigid3> world_from_board;  // one pose a pulse, then over again
    double room_electrons = 6;             // stray light on every pixel while the lenses are open
    double flat_electrons = 900;           // the evenly lit screen of a flat-field capture
  };
  explicit SimulatedBurner(Options options);

  // The flame that burns from now on; there is none before.
  void light(std::shared_ptr<const FlameFilm> film);

  // What the experimenter prepares before a capture: caps on for dark, the flame out for background, ...
  void show(CaptureKind kind);

  // Someone holds the board still, pose after pose, instead of turning it with every pulse.
  void hold_board(bool on);
  void turn_board();  // to the next pose

  // The cameras' view of it. Safe to call from all camera threads while the above change what there is.
  std::shared_ptr<const Image> picture(std::size_t camera, const Pulse& pulse) const;

 private:
  std::shared_ptr<const Image> even_light(std::size_t camera, double electrons) const;

  const Options options_;
  mutable std::mutex mutex_;  // what follows
  std::shared_ptr<const FlameFilm> film_;
  CaptureKind showing_ = CaptureKind::Dark;
  bool holds_ = false;
  std::size_t held_pose_ = 0;
};

}  // namespace flamefield
