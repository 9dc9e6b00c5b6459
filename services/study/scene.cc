#include "services/study/scene.h"

#include <algorithm>

#include "reconstruct/metrics.h"
#include "reconstruct/random.h"
#include "reconstruct/render.h"

namespace flamefield {

namespace {

Result<Volume> fine_field(const RunSettings& run, FieldFiles& fields) {
  if (run.field.empty()) {
    const Grid fine =
        centred_grid(run.nx * run.finer, run.ny * run.finer, run.nz * run.finer, run.spacing_mm / run.finer);
    if (auto ok = validate(fine); !ok) return tl::unexpected(ok.error());
    return make_phantom(run.phantom, fine);
  }
  const auto known = fields.get(run.field, run.field_spacing_mm);
  if (!known) return tl::unexpected(known.error());
  Volume volume = (*known)->volume;
  // Around the axis of the ring, wherever the file has its origin.
  volume.grid.origin_mm = centred_grid(volume.grid.nx, volume.grid.ny, volume.grid.nz, 1)
                              .origin_mm.cwiseProduct(volume.grid.spacing_mm);
  return volume;
}

// Independent numbers for every pixel.
void add_gaussian(Projections& images, double share, int seed) {
  const double sigma = share * *std::ranges::max_element(images.values);
  if (!(sigma > 0)) return;
  for (std::size_t i = 0; i < images.values.size(); ++i) {
    Stream stream(static_cast<std::uint64_t>(seed), i);
    images.values[i] += static_cast<float>(sigma * stream.normal());
  }
}

}  // namespace

Result<StudyScene> make_scene(const RunSettings& run, FieldFiles& fields, int threads) {
  auto fine = fine_field(run, fields);
  if (!fine) return tl::unexpected(fine.error());
  auto rig = make_ring(run.ring(), run.grid());
  if (!rig) return tl::unexpected(rig.error());
  auto images = render(
      *fine, *rig,
      {.step_voxels = run.step_voxels, .pixel_samples = run.pixel_samples, .lens = {}, .threads = threads});
  if (!images) return tl::unexpected(images.error());
  add_gaussian(*images, run.noise, run.noise_seed);
  const SensorNoise sensor{run.photons, run.read_noise, run.bits, static_cast<std::uint64_t>(run.noise_seed)};
  if (auto ok = add_noise(*images, sensor); !ok) return tl::unexpected(ok.error());
  return StudyScene{resample(*fine, run.grid()), std::move(*rig), std::move(*images)};
}

Result<std::shared_ptr<const StudyScene>> StudyScenes::get(const RunSettings& run, int threads) {
  std::shared_ptr<Entry> entry;
  {
    const std::lock_guard lock(mutex_);
    auto& slot = entries_[run.scene_id()];
    if (!slot) slot = std::make_shared<Entry>();
    entry = slot;
  }
  const std::lock_guard lock(entry->mutex);
  if (auto known = entry->scene.lock()) return known;
  auto made = make_scene(run, fields_, threads);
  if (!made) return tl::unexpected(made.error());
  auto scene = std::make_shared<const StudyScene>(std::move(*made));
  entry->scene = scene;
  return scene;
}

}  // namespace flamefield
