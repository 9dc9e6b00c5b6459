#include "services/store/volume_file.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <sstream>

#include "services/store/npy.h"
#include "services/store/volume_formats.h"

namespace flamefield {

namespace {

enum class Form { Vtkhdf, Vti, Npy, Tiff };

Result<Form> form_of(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (extension == ".vtkhdf") return Form::Vtkhdf;
  if (extension == ".vti") return Form::Vti;
  if (extension == ".npy") return Form::Npy;
  if (extension == ".tif" || extension == ".tiff") return Form::Tiff;
  return invalid_input(concat("'", path.string(), "' as a volume file"),
                       concat("its extension '", extension, "' is not known"),
                       "use .vtkhdf, .vti, .npy or .tif");
}

// A grid for values that came without coordinates.
Result<Volume> centred_volume(const std::filesystem::path& path, const std::vector<std::size_t>& shape,
                              std::vector<float> values, std::optional<double> spacing_mm) {
  if (shape.size() != 3 || std::any_of(shape.begin(), shape.end(), [](auto n) { return n > 1u << 20; })) {
    return invalid_input(concat("'", path.string(), "' has ", shape.size(), " dimensions"),
                         "a volume has shape (NZ, NY, NX)", "save it as a 3D float32 array");
  }
  Volume volume;
  volume.grid = centred_grid(static_cast<int>(shape[2]), static_cast<int>(shape[1]),
                             static_cast<int>(shape[0]), spacing_mm.value_or(1));
  if (auto ok = validate(volume.grid); !ok) {
    return invalid_input(concat("'", path.string(), "' is no volume"), ok.error().message,
                         "name another file");
  }
  volume.values = std::move(values);
  return volume;
}

constexpr std::string_view kTiffGrid = "flamefield-volume-1";

std::string describe(const Grid& grid) {
  std::ostringstream text;
  text.precision(17);
  text << kTiffGrid << " origin_mm " << grid.origin_mm.transpose() << " spacing_mm "
       << grid.spacing_mm.transpose();
  return text.str();
}

Result<Volume> read_tiff_volume(const std::filesystem::path& path, std::optional<double> spacing_mm) {
  auto stack = read_tiff_stack(path);
  if (!stack) return tl::unexpected(stack.error());
  auto volume = centred_volume(
      path,
      {stack->pages, static_cast<std::size_t>(stack->height_px), static_cast<std::size_t>(stack->width_px)},
      std::move(stack->values), spacing_mm);
  std::istringstream text(stack->description);
  std::string form, origin, spacing;
  Eigen::Vector3d o, s;
  if (volume && text >> form >> origin >> o[0] >> o[1] >> o[2] >> spacing >> s[0] >> s[1] >> s[2] &&
      form == kTiffGrid) {
    volume->grid.origin_mm = o;
    volume->grid.spacing_mm = s;
    if (auto ok = validate(volume->grid); !ok) return tl::unexpected(ok.error());
  }
  return volume;
}

Result<> write_tiff_volume(const std::filesystem::path& path, const Volume& volume) {
  const Grid& grid = volume.grid;
  return write_tiff_stack(
      path, {grid.nx, grid.ny, static_cast<std::size_t>(grid.nz), volume.values, describe(grid)});
}

Result<VolumeRecord> as_record(Result<Volume> volume) {
  if (!volume) return tl::unexpected(volume.error());
  return VolumeRecord{std::move(*volume), {}, {}};
}

Result<VolumeRecord> read_by_form(const std::filesystem::path& path, Form form,
                                  std::optional<double> spacing_mm) {
  switch (form) {
    case Form::Vtkhdf:
      return read_vtkhdf(path);
    case Form::Vti:
      return as_record(read_vti(path));
    case Form::Tiff:
      return as_record(read_tiff_volume(path, spacing_mm));
    case Form::Npy:
      break;
  }
  auto array = read_npy(path);
  if (!array) return tl::unexpected(array.error());
  return as_record(centred_volume(path, array->shape, std::move(array->values), spacing_mm));
}

}  // namespace

Result<> check_volume_name(const std::filesystem::path& path) {
  auto form = form_of(path);
  if (!form) return tl::unexpected(form.error());
  return {};
}

Result<VolumeRecord> read_volume_record(const std::filesystem::path& path, std::optional<double> spacing_mm) {
  auto form = form_of(path);
  if (!form) return tl::unexpected(form.error());
  auto record = read_by_form(path, *form, spacing_mm);
  if (!record || !spacing_mm) return record;
  const Eigen::Vector3d own = record->volume.grid.spacing_mm;
  if ((own.array() - *spacing_mm).abs().maxCoeff() > 1e-6 * std::abs(*spacing_mm)) {
    return invalid_input(concat("'", path.string(), "' has a spacing of ", own.transpose(), " mm"),
                         concat("--spacing-mm says ", *spacing_mm), "leave --spacing-mm out");
  }
  return record;
}

Result<Volume> read_volume(const std::filesystem::path& path, std::optional<double> spacing_mm) {
  auto record = read_volume_record(path, spacing_mm);
  if (!record) return tl::unexpected(record.error());
  return std::move(record->volume);
}

Result<> write_volume(const std::filesystem::path& path, const Volume& volume, const Provenance& provenance,
                      std::span<const float> sigma) {
  if (auto ok = validate(volume.grid); !ok) return ok;
  if (volume.values.size() != volume.grid.voxels() ||
      (!sigma.empty() && sigma.size() != volume.values.size())) {
    return invalid_input(concat("a volume of ", volume.values.size(), " values"),
                         concat("its grid has ", volume.grid.voxels(), " voxels"), "fill the whole grid");
  }
  auto form = form_of(path);
  if (!form) return tl::unexpected(form.error());
  switch (*form) {
    case Form::Vtkhdf:
      return write_vtkhdf(path, volume, provenance, sigma);
    case Form::Vti:
      return write_vti(path, volume);
    case Form::Tiff:
      return write_tiff_volume(path, volume);
    case Form::Npy:
      break;
  }
  const Grid& g = volume.grid;
  return write_npy(
      path, {static_cast<std::size_t>(g.nz), static_cast<std::size_t>(g.ny), static_cast<std::size_t>(g.nx)},
      volume.values);
}

}  // namespace flamefield
