#include "services/study/fields.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "proto/fingerprint.h"
#include "services/store/volume_file.h"

namespace flamefield {

namespace {

Result<> check_emission(const std::filesystem::path& path, const Volume& volume) {
  const auto bad =
      std::ranges::find_if_not(volume.values, [](float v) { return std::isfinite(v) && v >= 0; });
  if (bad != volume.values.end()) {
    const auto i = static_cast<std::size_t>(bad - volume.values.begin());
    const auto nx = static_cast<std::size_t>(volume.grid.nx), ny = static_cast<std::size_t>(volume.grid.ny);
    return invalid_input(
        concat(path.string(), ": voxel x=", i % nx, ", y=", i / nx % ny, ", z=", i / nx / ny, " is ", *bad),
        "a flame emits zero or more", "repair the field");
  }
  if (std::ranges::all_of(volume.values, [](float v) { return v == 0; }))
    return invalid_input(concat(path.string(), ": every voxel is zero"), "there is nothing to reconstruct",
                         "take a field with a flame in it");
  return {};
}

}  // namespace

Result<std::shared_ptr<const FieldFiles::Field>> FieldFiles::get(const std::filesystem::path& path,
                                                                 std::optional<double> spacing_mm) {
  const std::lock_guard lock(mutex_);
  const auto key = std::pair(path.lexically_normal().string(), spacing_mm.value_or(0));
  if (const auto known = known_.find(key); known != known_.end()) return known->second;
  auto volume = read_volume(path, spacing_mm);
  if (!volume) return tl::unexpected(volume.error());
  if (auto ok = check_emission(path, *volume); !ok) return tl::unexpected(ok.error());
  Fingerprint print;
  print.add(std::as_bytes(std::span(volume->values)));
  for (int axis = 0; axis < 3; ++axis) print.add(volume->grid.spacing_mm[axis]);
  auto field = std::make_shared<Field>();
  field->volume = std::move(*volume);
  field->fingerprint = print.text();
  return known_.emplace(key, std::move(field)).first->second;
}

}  // namespace flamefield
