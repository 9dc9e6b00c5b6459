// What the inner parts of a reconstruction cost; CPU time, one thread unless said.
// usage: bench_reconstruct [--benchmark_filter=REGEX]
#include <benchmark/benchmark.h>

#include <memory>

#include "reconstruct/phantom/phantom.h"
#include "reconstruct/prepare.h"
#include "reconstruct/projector.h"
#include "reconstruct/ring.h"

namespace flamefield {
namespace {

Grid flame_grid() {
  return centred_grid(52, 55, 52, 1);
}

// 15 sensors of 659 x 494 pixels, five across a voxel, that are tilted and have bent lenses.
Rig sensors() {
  Rig rig = *make_ring({.views = 15, .radius_mm = 300, .image_width_px = 659, .image_height_px = 494},
                       centred_grid(130, 97, 130, 1));
  for (Camera& c : rig.cameras) {
    c.distortion[0] = -0.05;
    const double angle = 0.02;
    Eigen::Matrix3d roll = Eigen::Matrix3d::Identity();
    roll.topLeftCorner<2, 2>() << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
    c.camera_from_world = Rigid3{roll, Eigen::Vector3d::Zero()} * c.camera_from_world;
  }
  return rig;
}

FrameSet pulse_of(const Rig& rig) {
  FrameSet set;
  for (const Camera& c : rig.cameras) {
    const auto size = static_cast<std::size_t>(c.image_width_px * c.image_height_px);
    set.frames.push_back({.camera = c.name,
                          .width_px = c.image_width_px,
                          .height_px = c.image_height_px,
                          .bytes = std::make_shared<const std::vector<std::byte>>(size, std::byte{17})});
  }
  return set;
}

void BM_PrepareSetUp(benchmark::State& state) {
  const Rig rig = sensors();
  Team team(1);
  for (auto _ : state) benchmark::DoNotOptimize(Preparer::make(rig, {}, flame_grid(), {}, team));
}
BENCHMARK(BM_PrepareSetUp)->Unit(benchmark::kMillisecond);

void BM_UnpackOnePulse(benchmark::State& state) {
  const std::vector<FrameSet> sets = {pulse_of(sensors())};
  for (auto _ : state) benchmark::DoNotOptimize(mean_images(sets));
}
BENCHMARK(BM_UnpackOnePulse)->Unit(benchmark::kMillisecond);

void BM_PrepareOnePulse(benchmark::State& state) {
  const Rig rig = sensors();
  const MeanImages flame = *mean_images({pulse_of(rig)});
  Team team(1);
  const Preparer preparer = *Preparer::make(rig, {flame, flame, flame}, flame_grid(), {}, team);
  for (auto _ : state) benchmark::DoNotOptimize(preparer(flame, team));
}
BENCHMARK(BM_PrepareOnePulse)->Unit(benchmark::kMillisecond);

struct CaseA {
  Team team{1};
  Projector projector = *Projector::make(*make_ring({}, flame_grid()), flame_grid(), {}, team);
  std::vector<float> volume =
      projector.layout().pack_volume(make_phantom({.kind = PhantomKind::Stratified}, flame_grid()).values);
  std::vector<float> images = std::vector<float>(projector.layout().pixels());
};

void BM_ForwardCaseA(benchmark::State& state) {
  CaseA a;
  for (auto _ : state) a.projector.forward(a.team, a.volume, a.images);
}
BENCHMARK(BM_ForwardCaseA)->Unit(benchmark::kMicrosecond);

void BM_AdjointCaseA(benchmark::State& state) {
  CaseA a;
  a.projector.forward(a.team, a.volume, a.images);
  for (auto _ : state) a.projector.adjoint(a.team, a.images, a.volume);
}
BENCHMARK(BM_AdjointCaseA)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace flamefield

BENCHMARK_MAIN();
