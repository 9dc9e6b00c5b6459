#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>

#include "acquire/settings.h"
#include "acquire/simulator/simulated_array.h"
#include "proto/board.h"
#include "proto/rig.h"
#include "services/acquisition/hooks.h"
#include "services/simulation/burner.h"
#include "services/simulation/flame_film.h"

namespace flamefield {

struct LaboratoryOptions {
  int cameras = 15;
  int board_poses = 24;
  double rate_hz = 5;                       // of the signal generator
  double board_rate_hz = 4;                 // at most, while someone turns the board
  std::string first_address = "127.0.0.2";  // of the cameras; the others follow
  double link_mbit_per_s = 0;               // of each camera's network port; 0: as fast as it goes
  bool answers_broadcasts = false;          // discovery by other programs; one array a machine can
  std::uint64_t seed = 1;
  double height_mm = 40;  // HAB of the ring's plane and of the middle of the flame's box
  FlameFilmOptions film;  // its grid is centred at that height
};

// A simulated laboratory: a burner amid a ring of real GigE Vision devices on the loopback interface, whose
// true places are known, and the signal generator on their trigger line.
class Laboratory {
 public:
  // Sets up cameras and burner, without a flame yet. Unavailable: the cameras' addresses are in use.
  static Result<std::unique_ptr<Laboratory>> open(const LaboratoryOptions& options);
  // Renders what the cameras will see of the flame; until then the burner is dark. Unavailable: stopped.
  Result<> light_flame(const FlameFilm::Progress& progress, std::stop_token stop);
  ~Laboratory();

  SimulatedArray& array() { return *array_; }
  const SimulatedArray& array() const { return *array_; }
  // While a capture of the board runs without an end, its pose stays until this is called.
  void turn_board() { burner_->turn_board(); }
  // What stands in front of the cameras, from the next pulse on.
  void show(CaptureKind kind) { burner_->show(kind); }
  const Rig& true_rig() const { return true_rig_; }
  const FlameFilm& film() const { return *film_; }  // contract: lit
  BoardSpec board() const { return board_; }
  // The pose of the board that stands on the burner at the first pulse of a board capture.
  const Rigid3& world_from_reference_board() const { return world_from_reference_board_; }
  std::vector<CameraAddress> cameras() const;
  // Gain and exposure that suit the dim flame.
  CameraSettings camera_settings(PixelFormat format) const;
  // Of images taken with those settings: what `prepare.counts_per_unit` is made of.
  double grey_levels_per_electron(PixelFormat format) const;

  // What the experimenter does around a capture: prepares the burner, starts the signal generator once the
  // cameras are armed, and stops it.
  CaptureHooks hooks();

 private:
  Laboratory() = default;
  LaboratoryOptions options_;
  Rig true_rig_;
  BoardSpec board_;
  Rigid3 world_from_reference_board_;
  std::shared_ptr<const FlameFilm> film_;
  std::shared_ptr<SimulatedBurner> burner_;
  std::unique_ptr<SimulatedArray> array_;
};

}  // namespace flamefield
