#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "proto/volume.h"

namespace flamefield {

// Planes begin .. end - 1 of constant z.
struct Planes {
  int begin = 0, end = 0;
  int count() const { return end - begin; }
  bool operator==(const Planes&) const = default;
};

// How the mathematics keeps volumes and images in memory: vertical columns contiguous, bottom first, each
// padded to whole SIMD vectors. A column of voxels then maps onto a column of pixels of a level camera with
// unit strides on both sides. Padding is zero and stays zero: solvers treat it like a voxel or pixel that no
// ray meets. Volumes have shape (nz, nx, column), images (views, cols, line).
struct Layout {
  int nx = 0, ny = 0, nz = 0;
  int views = 0, rows = 0, cols = 0;
  std::size_t column = 0;  // floats from a column of voxels to the next
  std::size_t line = 0;    // floats from a column of pixels to the next

  Layout() = default;
  Layout(const Grid& grid, int view_count, int image_rows, int image_cols);

  std::size_t voxels() const { return std::size_t(nz) * std::size_t(nx) * column; }  // with padding
  std::size_t pixels_per_view() const { return std::size_t(cols) * line; }           // with padding
  std::size_t pixels() const { return std::size_t(views) * pixels_per_view(); }
  std::size_t voxel(int x, int y, int z) const {
    return (std::size_t(z) * std::size_t(nx) + std::size_t(x)) * column + std::size_t(y);
  }
  // row: from the top, as in Image
  std::size_t pixel(int view, int row, int col) const {
    return (std::size_t(view) * std::size_t(cols) + std::size_t(col)) * line + std::size_t(rows - 1 - row);
  }

  std::vector<float> pack_volume(std::span<const float> volume) const;    // from (nz, ny, nx)
  std::vector<float> unpack_volume(std::span<const float> packed) const;  // to (nz, ny, nx)
  std::vector<float> pack_images(std::span<const float> images) const;    // from (views, rows, cols)
  std::vector<float> unpack_images(std::span<const float> packed) const;  // to (views, rows, cols)
};

}  // namespace flamefield
