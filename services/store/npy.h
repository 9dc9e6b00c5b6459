#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

#include "proto/error.h"

namespace flamefield {

struct NpyArray {
  std::vector<std::size_t> shape;
  std::vector<float> values;  // C order, last index fastest
};

// NumPy's .npy, versions 1 to 3 (numpy.lib.format). Reads float32 and float64 of either byte order in C
// order; anything else is InvalidInput that names the file and says how to convert it. The header is checked
// against the file's size before anything is allocated.
Result<NpyArray> read_npy(const std::filesystem::path& path);

// Writes version 1.0, '<f4', C order.
Result<> write_npy(const std::filesystem::path& path, const std::vector<std::size_t>& shape,
                   std::span<const float> values);

}  // namespace flamefield
