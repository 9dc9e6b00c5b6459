#include "reconstruct/layout.h"

#include "proto/check.h"

namespace flamefield {

namespace {

constexpr std::size_t kLanes = 16;  // floats of the widest vector

std::size_t padded(int size) {
  return (static_cast<std::size_t>(size) + kLanes - 1) / kLanes * kLanes;
}

// visit(index in the plain array, index in the packed one)
template <class Visit>
void each_voxel(const Layout& l, const Visit& visit) {
  std::size_t plain = 0;
  for (int z = 0; z < l.nz; ++z)
    for (int y = 0; y < l.ny; ++y)
      for (int x = 0; x < l.nx; ++x) visit(plain++, l.voxel(x, y, z));
}

template <class Visit>
void each_pixel(const Layout& l, const Visit& visit) {
  std::size_t plain = 0;
  for (int v = 0; v < l.views; ++v)
    for (int row = 0; row < l.rows; ++row)
      for (int col = 0; col < l.cols; ++col) visit(plain++, l.pixel(v, row, col));
}

}  // namespace

Layout::Layout(const Grid& grid, int view_count, int image_rows, int image_cols)
    : nx(grid.nx),
      ny(grid.ny),
      nz(grid.nz),
      views(view_count),
      rows(image_rows),
      cols(image_cols),
      column(padded(grid.ny)),
      line(padded(image_rows)) {}

std::vector<float> Layout::pack_volume(std::span<const float> volume) const {
  expect(volume.size() == std::size_t(nx) * std::size_t(ny) * std::size_t(nz), "the volume fits the layout");
  std::vector<float> out(voxels(), 0.0f);
  each_voxel(*this, [&](std::size_t plain, std::size_t packed) { out[packed] = volume[plain]; });
  return out;
}

std::vector<float> Layout::unpack_volume(std::span<const float> packed) const {
  expect(packed.size() == voxels(), "the volume fits the layout");
  std::vector<float> out(std::size_t(nx) * std::size_t(ny) * std::size_t(nz));
  each_voxel(*this, [&](std::size_t plain, std::size_t at) { out[plain] = packed[at]; });
  return out;
}

std::vector<float> Layout::pack_images(std::span<const float> images) const {
  expect(images.size() == std::size_t(views) * std::size_t(rows) * std::size_t(cols),
         "the images fit the layout");
  std::vector<float> out(pixels(), 0.0f);
  each_pixel(*this, [&](std::size_t plain, std::size_t packed) { out[packed] = images[plain]; });
  return out;
}

std::vector<float> Layout::unpack_images(std::span<const float> packed) const {
  expect(packed.size() == pixels(), "the images fit the layout");
  std::vector<float> out(std::size_t(views) * std::size_t(rows) * std::size_t(cols));
  each_pixel(*this, [&](std::size_t plain, std::size_t at) { out[plain] = packed[at]; });
  return out;
}

}  // namespace flamefield
