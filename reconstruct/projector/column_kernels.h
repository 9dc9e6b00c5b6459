#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "reconstruct/projector/footprint.h"

namespace flamefield {

// The inner loops of the projector. A pixel column of a level camera meets a plane of voxels in a vertical
// line. A strip is what they share: the neighbouring voxel columns, blended into one, onto which the pixels
// map affinely. A patch is a few neighbouring pixel columns on a few consecutive planes, at most kPatch
// strips, the planes of the first pixel column first.
constexpr int kPatch = 16;
struct StripPatch {
  int cols = 0, planes = 0;
  // Of each strip, kPatch floats that may be read; in voxels but for the last:
  const float* q = nullptr;        // where the line meets the plane
  const float* half = nullptr;     // half the width that a pixel averages over
  const float* m = nullptr;        // height of a pixel
  const float* half_px = nullptr;  // half the height that a pixel averages over, px; 0: a point
  // Each so many planes, counted from the first, share m and half_px: their blends are resampled as one.
  int alike = 1;
  std::size_t plane = 0, plane_step = 0;  // first voxel of the first strip's plane; floats to the next plane
  std::size_t line = 0, line_step = 0;    // bottom pixel of the first pixel column; floats to the next

  int strips() const { return cols * planes; }
};

struct StripShape {
  int ny = 0;              // voxels in a column
  std::size_t column = 0;  // floats in a column, a multiple of 16; padding is zero
  int others = 0;          // voxel columns in a plane
  int begin = 0, end = 0;  // those of them that count
  std::size_t stride = 0;  // floats from one to the next
  int rows = 0;            // pixels in a line
  std::size_t line = 0;    // floats in a line, a multiple of 16; padding is zero
  double height = 0;       // of the camera's centre above voxel row 0, voxels
  double axis_up = 0;  // of the principal point above the bottom row, px: pixel `up` looks at voxel height
                       // + m (up - axis_up)
};

// Buffers for one thread.
class KernelScratch {
 public:
  void fit(const StripShape& shape);
  float* buffer(std::size_t i) { return data_.data() + offset_ + i * span_; }
  float* zero_edged() { return buffer(kBuffers - 1); }  // nobody writes to its margins: they stay zero

 private:
  static constexpr std::size_t kBuffers = 5;
  std::size_t span_ = 0, offset_ = 0, line_ = 0;
  std::vector<float> data_;
};

// The vector kernels want four voxel columns or more in a plane and in what counts of it. They
// handle pixels between half a voxel and 1.75 voxels high that average over at most one voxel to each side;
// the plain ones everything. Both compute the same sums.
constexpr int kFewestVectorColumns = 4;
constexpr double kSmallestVectorM = 0.5, kLargestVectorM = 1.75, kLargestVectorHalf = 1;

// images += strips of `volume`, without the factor of length. Padding of lines may become non-zero.
// lit: whether each voxel column of the volume, in memory order, holds anything but zero; strips of dark
// columns are passed over.
void add_forward(const float* volume, const std::uint8_t* lit, const StripPatch& patch,
                 const StripShape& shape, KernelScratch& scratch, float* images);
void add_forward_plain(const float* volume, const StripPatch& patch, const StripShape& shape, float* images);

// volume += strips transposed times images. Padding of columns may become non-zero.
void add_adjoint(const float* images, const StripPatch& patch, const StripShape& shape,
                 KernelScratch& scratch, float* volume);
void add_adjoint_plain(const float* images, const StripPatch& patch, const StripShape& shape, float* volume);

// Which instruction set the vector kernels use here, e.g. "AVX3".
const char* vector_target();

}  // namespace flamefield
