#pragma once

#include "services/store/volume_file.h"

namespace flamefield {

// One pair for each form of a volume file; volume_file.cc chooses by extension.
// VTKHDF ImageData 1.0 (docs.vtk.org, "VTKHDF file format"), the dataset hard-linked as NeXus NXdata.
Result<VolumeRecord> read_vtkhdf(const std::filesystem::path& path);
Result<> write_vtkhdf(const std::filesystem::path& path, const Volume& volume, const Provenance& provenance,
                      std::span<const float> sigma);

// VTK XML ImageData with raw appended Float32 data; reads what it writes.
Result<Volume> read_vti(const std::filesystem::path& path);
Result<> write_vti(const std::filesystem::path& path, const Volume& volume);

// A BigTIFF stack, one float32 page a z-slice, with the grid in the first page's description. Pages of other
// programs may be 8 or 16 bit integers; their grid is absent.
struct TiffStack {
  int width_px = 0, height_px = 0;
  std::size_t pages = 0;
  std::vector<float> values;  // (pages, rows, cols)
  std::string description;    // of the first page
};
Result<TiffStack> read_tiff_stack(const std::filesystem::path& path);
Result<> write_tiff_stack(const std::filesystem::path& path, const TiffStack& stack);

}  // namespace flamefield
