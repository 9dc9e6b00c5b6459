#include "services/bench/projector_bench.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "reconstruct/projector.h"
#include "reconstruct/ring.h"
#include "services/bench/stopwatch.h"

namespace flamefield {

namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180;
constexpr double kRadius_mm = 300, kBox_mm = 52;

// A value in [0, 1) that depends on its index alone, so that random arrays need not be kept for the check.
float noise_at(std::size_t index, std::uint32_t salt) {
  std::uint32_t h = static_cast<std::uint32_t>(index) * 0x9e3779b9u + salt;
  h = (h ^ (h >> 16)) * 0x85ebca6bu;
  h = (h ^ (h >> 13)) * 0xc2b2ae35u;
  return static_cast<float>((h ^ (h >> 16)) >> 8) * 0x1p-24f;
}

constexpr std::uint32_t kVolumeSalt = 1, kImageSalt = 0x51ed270b;

// visit(index) for what is not padding: `count` of every `pitch` floats.
template <class Visit>
void each(std::size_t size, std::size_t pitch, int count, const Visit& visit) {
  for (std::size_t start = 0; start < size; start += pitch)
    for (std::size_t i = start; i < start + static_cast<std::size_t>(count); ++i) visit(i);
}

struct Least {
  double cpu_s = std::numeric_limits<double>::infinity(), wall_s = cpu_s;
  int repetitions = 0;
};

// CPU time is the least of a repetition on one thread. On several the clock misses what the others have not
// yet handed in, so that it is the mean over all repetitions.
template <class Work>
Least least_of(double seconds, int threads, const Work& work) {
  Least least;
  const Stopwatch whole;
  while (least.repetitions < 3 || whole.wall_s() < seconds) {
    const Stopwatch watch;
    work();
    least.cpu_s = std::min(least.cpu_s, watch.cpu_s());
    least.wall_s = std::min(least.wall_s, watch.wall_s());
    ++least.repetitions;
  }
  if (threads > 1) least.cpu_s = whole.cpu_s() / least.repetitions;
  return least;
}

}  // namespace

double ProjectorCase::samples() const {
  return double(views) * double(rows) * double(cols) * double(std::max(nx, nz));
}

double ProjectorCase::mib() const {
  return double(nx) * double(ny) * double(nz) * sizeof(float) / (1 << 20);
}

Result<ProjectorCase> projector_case(const std::string& name) {
  if (name == "A") return ProjectorCase{"A", 15, 12 * kRadPerDeg, 55, 52, 52, 55, 52};
  if (name == "B") return ProjectorCase{"B", 24, 7.5 * kRadPerDeg, 256, 256, 256, 256, 256};
  if (name == "C") return ProjectorCase{"C", 24, 7.5 * kRadPerDeg, 512, 512, 512, 512, 512};
  return invalid_input(concat("case '", name, "'"), "there is none of this name", "use A, B or C");
}

std::string name_of(ProjectorModel model) {
  return model == ProjectorModel::Ray ? "ray" : model == ProjectorModel::Area ? "area" : "trilinear";
}

Result<ProjectorModel> projector_model(const std::string& name) {
  for (auto model : {ProjectorModel::Ray, ProjectorModel::Area, ProjectorModel::Trilinear})
    if (name == name_of(model)) return model;
  return invalid_input(concat("model '", name, "'"), "there is none of this name",
                       "use ray, area or trilinear");
}

Result<ProjectorMeasurement> measure_projector(const ProjectorCase& what, ProjectorModel model,
                                               const std::vector<int>& threads, double seconds_each,
                                               const std::function<void(const std::string&)>& progress) {
  const Grid grid = centred_grid(what.nx, what.ny, what.nz, kBox_mm / what.nx);
  const auto rig = make_ring({.views = what.views,
                              .spacing_rad = what.spacing_rad,
                              .radius_mm = kRadius_mm,
                              .image_width_px = what.cols,
                              .image_height_px = what.rows},
                             grid);
  if (!rig) return tl::unexpected(rig.error());
  progress("set up");
  ProjectorMeasurement out;
  Team everyone;
  const Stopwatch set_up;
  ProjectorOptions options;
  options.trilinear = model == ProjectorModel::Trilinear;
  options.pixel_area = model == ProjectorModel::Area;
  options.pixel_samples = 1;
  const auto projector = Projector::make(*rig, grid, options, everyone);
  if (!projector) return tl::unexpected(projector.error());
  out.set_up_wall_s = set_up.wall_s();
  out.engine = projector->engine();

  const Layout& l = projector->layout();
  std::vector<float> volume(l.voxels(), 0.0f), images(l.pixels(), 0.0f);
  each(volume.size(), l.column, l.ny, [&](std::size_t i) { volume[i] = noise_at(i, kVolumeSalt); });
  for (int count : threads) {
    progress(concat("forward, ", count, count == 1 ? " thread" : " threads"));
    Team team(count);
    const Least least = least_of(seconds_each, count, [&] { projector->forward(team, volume, images); });
    out.timings.push_back({count, least.repetitions, least.cpu_s, least.wall_s, 0, 0});
  }
  double image_side = 0, volume_side = 0;
  each(images.size(), l.line, l.rows, [&](std::size_t i) {
    image_side += static_cast<double>(images[i]) * static_cast<double>(noise_at(i, kImageSalt));
  });
  each(images.size(), l.line, l.rows, [&](std::size_t i) { images[i] = noise_at(i, kImageSalt); });
  for (ProjectorTiming& timing : out.timings) {
    progress(concat("adjoint, ", timing.threads, timing.threads == 1 ? " thread" : " threads"));
    Team team(timing.threads);
    const Least least =
        least_of(seconds_each, timing.threads, [&] { projector->adjoint(team, images, volume); });
    timing.adjoint_cpu_s = least.cpu_s;
    timing.adjoint_wall_s = least.wall_s;
  }
  each(volume.size(), l.column, l.ny, [&](std::size_t i) {
    volume_side += static_cast<double>(volume[i]) * static_cast<double>(noise_at(i, kVolumeSalt));
  });
  out.adjoint_mismatch = std::abs(image_side - volume_side) / std::abs(image_side);
  return out;
}

}  // namespace flamefield
