#include "services/simulation/laboratory.h"

#include <algorithm>
#include <cmath>

#include "acquire/simulator/true_rig.h"

namespace flamefield {

namespace {

constexpr double kLevels12 = 4095;  // grey levels of 12 bits at full well and gain 0
constexpr int kGainRaw = 500;       // about 18 dB: 2,300 photo-electrons fill the scale

Result<std::unique_ptr<SimulatedArray>> open_array(const LaboratoryOptions& options) {
  SimulatedArrayOptions array;
  array.cameras = static_cast<std::size_t>(options.cameras);
  array.first_address = options.first_address;
  array.line_rate_bits_per_s = 1e6 * options.link_mbit_per_s;
  array.answers_broadcasts = options.answers_broadcasts;
  array.seed = options.seed;
  return SimulatedArray::open(array);
}

}  // namespace

Result<std::unique_ptr<Laboratory>> Laboratory::open(const LaboratoryOptions& options) {
  std::unique_ptr<Laboratory> laboratory(new Laboratory);
  laboratory->options_ = options;
  auto array = open_array(options);
  if (!array) return tl::unexpected(array.error());
  laboratory->array_ = std::move(*array);
  laboratory->true_rig_ = ring_with_tolerances(
      {.cameras = options.cameras, .height_mm = options.height_mm, .seed = options.seed});

  BoardPosesOptions poses;
  poses.count = options.board_poses;
  poses.last_azimuth_rad = (options.cameras - 1) * TrueRigOptions{}.spacing_rad;
  poses.centre_mm = {0, options.height_mm, 0};
  poses.seed = options.seed;
  SimulatedBurner::Options burner;
  burner.true_rig = laboratory->true_rig_;
  burner.world_from_board = board_poses(poses);
  burner.board.full_scale_electrons = 2200;  // the room light fills the scale at the flame's gain
  laboratory->board_ = burner.board.board;
  laboratory->world_from_reference_board_ = burner.world_from_board.front();

  laboratory->burner_ = std::make_shared<SimulatedBurner>(std::move(burner));
  laboratory->array_->set_scene([burner = laboratory->burner_](std::size_t camera, const Pulse& pulse) {
    return burner->picture(camera, pulse);
  });
  return laboratory;
}

Result<> Laboratory::light_flame(const FlameFilm::Progress& progress, std::stop_token stop) {
  auto film = FlameFilm::render(options_.film, true_rig_, progress, std::move(stop));
  if (!film) return tl::unexpected(film.error());
  film_ = std::make_shared<const FlameFilm>(std::move(*film));
  burner_->light(film_);
  return {};
}

Laboratory::~Laboratory() {
  if (array_) array_->generator().stop();
}

std::vector<CameraAddress> Laboratory::cameras() const {
  std::vector<CameraAddress> out;
  const auto names = array_->names(), addresses = array_->addresses();
  for (std::size_t i = 0; i < names.size(); ++i) out.push_back({names[i], addresses[i]});
  return out;
}

CameraSettings Laboratory::camera_settings(PixelFormat format) const {
  CameraSettings settings;
  settings.exposure_us = static_cast<int>(kSceneExposure_us);
  settings.gain_raw = kGainRaw;
  settings.pixel_format = format;
  return settings;
}

double Laboratory::grey_levels_per_electron(PixelFormat format) const {
  const SensorModel sensor;
  const double levels = format == PixelFormat::Mono8 ? kLevels12 / 16 : kLevels12;
  return levels / sensor.full_well_e * std::pow(10, sensor.gain_db_per_raw_step * kGainRaw / 20);
}

CaptureHooks Laboratory::hooks() {
  return {.before = [this](CaptureKind kind) { show(kind); },
          .armed =
              [this](CaptureKind kind, std::int64_t pulses) {
                const bool is_board = kind == CaptureKind::Board;
                burner_->hold_board(is_board && pulses == 0);
                array_->generator().start(
                    is_board ? std::min(options_.board_rate_hz, options_.rate_hz) : options_.rate_hz, pulses);
              },
          .finished = [this] { array_->generator().stop(); }};
}

}  // namespace flamefield
