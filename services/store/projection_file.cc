#include "services/store/projection_file.h"

#include "proto/camera_name.h"
#include "proto/check.h"
#include "services/store/file.h"
#include "services/store/h5_output.h"
#include "services/store/npy.h"
#include "services/store/volume_formats.h"

namespace flamefield {

namespace {

bool is_tiff(const std::filesystem::path& path) {
  return path.extension() == ".tif" || path.extension() == ".tiff";
}

Result<Projections> read_nxs(const std::filesystem::path& path) {
  if (auto found = open_input(path); !found) return tl::unexpected(found.error());
  return h5_result(path, "read", [&]() -> Result<Projections> {
    const H5File file = H5File::open(path);
    const H5Group data = file.group("entry").group("data");
    Projections projections;
    projections.view_names = data.read_texts("view");
    const H5Shape shape = data.checked_shape("data");
    if (shape.size() != 3 || shape[0] != projections.view_names.size() || shape[1] > 1u << 20 ||
        shape[2] > 1u << 20) {
      throw H5Failure("/entry/data/data does not have the shape (view, row, col)");
    }
    projections.rows = static_cast<int>(shape[1]);
    projections.cols = static_cast<int>(shape[2]);
    H5Shape again;
    projections.values = data.read<float>("data", again);
    return projections;
  });
}

Result<> write_nxs(const std::filesystem::path& path, const Projections& p, const Provenance& provenance) {
  return write_h5(path, [&](H5File& file) -> Result<> {
    file.set_text("default", "entry");
    H5Group entry = file.create_group("entry", "NXentry");
    entry.set_text("default", "data");
    H5Group data = entry.create_group("data", "NXdata");
    data.set_text("signal", "data");
    data.set_texts("axes", {"view", ".", "."});
    data.write<float>("data", p.values,
                      {p.views(), static_cast<std::size_t>(p.rows), static_cast<std::size_t>(p.cols)},
                      H5Layout::Checked);
    data.set_text("long_name", "line-of-sight integral (field unit x mm)", "data");
    data.write_texts("view", p.view_names);
    write_provenance(entry, provenance);
    return {};
  });
}

// Values with a shape but without names.
Result<Projections> named(const std::filesystem::path& path, const std::vector<std::size_t>& shape,
                          std::vector<float> values, const Rig* rig) {
  if (shape.size() != 3 || shape[1] > 1u << 20 || shape[2] > 1u << 20) {
    return invalid_input(concat("'", path.string(), "' has ", shape.size(), " dimensions"),
                         "projections have shape (views, rows, cols)", "save them as a 3D float32 array");
  }
  if (rig && rig->cameras.size() != shape[0]) {
    return invalid_input(concat("'", path.string(), "' has ", shape[0], " views"),
                         concat("the rig has ", rig->cameras.size(), " cameras"),
                         "give the views in the rig's order, one a camera");
  }
  Projections projections;
  projections.rows = static_cast<int>(shape[1]);
  projections.cols = static_cast<int>(shape[2]);
  projections.values = std::move(values);
  for (std::size_t i = 0; i < shape[0]; ++i)
    projections.view_names.push_back(rig ? rig->cameras[i].name : camera_name(i));
  return projections;
}

}  // namespace

Result<> check_projection_name(const std::filesystem::path& path) {
  if (path.extension() == ".nxs" || path.extension() == ".npy" || is_tiff(path)) return {};
  return invalid_input(concat("'", path.string(), "' as a projection file"),
                       concat("its extension '", path.extension().string(), "' is not known"),
                       "use .nxs, .npy or .tif");
}

Result<Projections> read_projections(const std::filesystem::path& path, const Rig* rig) {
  if (auto ok = check_projection_name(path); !ok) return tl::unexpected(ok.error());
  if (path.extension() == ".nxs") return read_nxs(path);
  if (is_tiff(path)) {
    auto stack = read_tiff_stack(path);
    if (!stack) return tl::unexpected(stack.error());
    return named(
        path,
        {stack->pages, static_cast<std::size_t>(stack->height_px), static_cast<std::size_t>(stack->width_px)},
        std::move(stack->values), rig);
  }
  auto array = read_npy(path);
  if (!array) return tl::unexpected(array.error());
  return named(path, array->shape, std::move(array->values), rig);
}

Result<> write_projections(const std::filesystem::path& path, const Projections& p,
                           const Provenance& provenance) {
  expect(p.values.size() == p.views() * p.pixels_per_view(), "projections hold all their pixels");
  if (auto ok = check_projection_name(path); !ok) return ok;
  if (path.extension() == ".nxs") return write_nxs(path, p, provenance);
  if (is_tiff(path))
    return write_tiff_stack(path, {p.cols, p.rows, p.views(), p.values, "flamefield projections"});
  return write_npy(path, {p.views(), static_cast<std::size_t>(p.rows), static_cast<std::size_t>(p.cols)},
                   p.values);
}

Result<Rig> rig_of_views(const Rig& rig, const Projections& projections, const std::filesystem::path& path) {
  Rig chosen;
  if (rig.quality) chosen.quality = RigQuality{rig.quality->rms_px, rig.quality->board_poses, {}};
  for (const std::string& name : projections.view_names) {
    const auto i = rig.find(name);
    if (!i) {
      return invalid_input(concat("view '", name, "' has no camera in '", path.string(), "'"),
                           "every view needs the geometry of its camera",
                           "calibrate that camera or take the rig that belongs to the projections");
    }
    chosen.cameras.push_back(rig.cameras[*i]);
    if (rig.quality) chosen.quality->cameras.push_back(rig.quality->cameras[*i]);
  }
  return chosen;
}

}  // namespace flamefield
