#include <array>

#include "services/store/file.h"
#include "services/store/h5_output.h"
#include "services/store/volume_formats.h"

namespace flamefield {

namespace {

H5Shape shape_of(const Grid& grid) {
  return {static_cast<std::size_t>(grid.nz), static_cast<std::size_t>(grid.ny),
          static_cast<std::size_t>(grid.nx)};
}

void write_field(H5Group& vtk, const Volume& volume, std::span<const float> sigma) {
  const Grid& grid = volume.grid;
  const std::array<std::int64_t, 2> version = {1, 0};
  vtk.set_integers("Version", version);
  vtk.set_text("Type", "ImageData");  // VTK insists on a fixed-length ASCII string
  const std::array<std::int64_t, 6> extent = {0, grid.nx - 1, 0, grid.ny - 1, 0, grid.nz - 1};
  vtk.set_integers("WholeExtent", extent);
  vtk.set_reals("Origin", {grid.origin_mm.data(), 3});
  vtk.set_reals("Spacing", {grid.spacing_mm.data(), 3});
  const std::array<double, 9> direction = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  vtk.set_reals("Direction", direction);
  H5Group points = vtk.create_group("PointData", "");
  points.write<float>("emission", volume.values, shape_of(grid), H5Layout::Checked);
  if (!sigma.empty()) points.write<float>("sigma", sigma, shape_of(grid), H5Layout::Checked);
}

// The same dataset once more, as NeXus readers look for it.
void link_as_nexus(H5File& file, H5Group& points, const Grid& grid, const Provenance& provenance) {
  file.set_text("default", "entry");
  H5Group entry = file.create_group("entry", "NXentry");
  entry.set_text("default", "data");
  H5Group data = entry.create_group("data", "NXdata");
  data.set_text("signal", "emission");
  data.set_texts("axes", {"z", "y", "x"});
  points.link("emission", data, "emission");
  if (points.has("sigma")) points.link("sigma", data, "emission_errors");
  const std::array<std::pair<const char*, int>, 3> axes = {{{"x", grid.nx}, {"y", grid.ny}, {"z", grid.nz}}};
  for (Eigen::Index a = 0; a < 3; ++a) {
    const auto& [name, count] = axes[static_cast<std::size_t>(a)];
    std::vector<double> centres_mm;
    for (int i = 0; i < count; ++i) centres_mm.push_back(grid.origin_mm[a] + i * grid.spacing_mm[a]);
    data.write<double>(name, centres_mm, {centres_mm.size()});
    data.set_text("units", "mm", name);
  }
  write_provenance(entry, provenance);
}

void refuse_rotation(const std::vector<double>& direction) {
  const std::vector<double> identity = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  if (direction != identity) throw H5Failure("its axes are rotated (Direction), which is not supported");
}

Grid read_grid(const H5Group& vtk) {
  if (vtk.text("Type") != "ImageData") throw H5Failure("its VTKHDF type is not ImageData");
  const auto extent = vtk.integers("WholeExtent");
  const auto origin = vtk.reals("Origin"), spacing = vtk.reals("Spacing");
  if (extent.size() != 6 || origin.size() != 3 || spacing.size() != 3)
    throw H5Failure("an attribute of /VTKHDF has the wrong length");
  Grid grid;
  const std::array<int*, 3> sides = {&grid.nx, &grid.ny, &grid.nz};
  for (std::size_t a = 0; a < 3; ++a) {
    const std::int64_t first = extent[2 * a], last = extent[2 * a + 1];
    if (first < -(1 << 24) || last < first || last > (1 << 24))
      throw H5Failure("WholeExtent is out of range");
    *sides[a] = static_cast<int>(last - first + 1);
    const auto i = static_cast<Eigen::Index>(a);
    grid.spacing_mm[i] = spacing[a];
    grid.origin_mm[i] = origin[a] + static_cast<double>(first) * spacing[a];
  }
  if (vtk.has("Direction")) refuse_rotation(vtk.reals("Direction"));
  return grid;
}

}  // namespace

Result<> write_vtkhdf(const std::filesystem::path& path, const Volume& volume, const Provenance& provenance,
                      std::span<const float> sigma) {
  return write_h5(path, [&](H5File& file) -> Result<> {
    H5Group vtk = file.create_group("VTKHDF", "");
    write_field(vtk, volume, sigma);
    H5Group points = vtk.group("PointData");
    link_as_nexus(file, points, volume.grid, provenance);
    return {};
  });
}

Result<VolumeRecord> read_vtkhdf(const std::filesystem::path& path) {
  if (auto found = open_input(path); !found) return tl::unexpected(found.error());
  return h5_result(path, "read", [&]() -> Result<VolumeRecord> {
    const H5File file = H5File::open(path);
    const H5Group vtk = file.group("VTKHDF");
    VolumeRecord record;
    record.volume.grid = read_grid(vtk);
    if (auto ok = validate(record.volume.grid); !ok) return tl::unexpected(ok.error());
    const H5Group points = vtk.group("PointData");
    const auto read = [&](const std::string& name) {
      H5Shape shape = points.checked_shape(name);
      if (shape != shape_of(record.volume.grid))
        throw H5Failure(name + " does not have the shape of WholeExtent");
      return points.read<float>(name, shape);
    };
    record.volume.values = read("emission");
    if (points.has("sigma")) record.sigma = read("sigma");
    if (file.has("entry") && file.group("entry").has("provenance")) {
      record.provenance = file.group("entry").group("provenance").all_texts();
      record.provenance.erase("NX_class");
    }
    return record;
  });
}

}  // namespace flamefield
