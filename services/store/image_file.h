#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "proto/error.h"
#include "proto/image.h"

namespace flamefield {

// A picture's grey levels, 8 or 16 bits: .png .jpg .tif .bmp .pgm. Colours are averaged as OpenCV does.
Result<Image> read_grey_image(const std::filesystem::path& path);

// The pictures of a folder, sorted by name; other files are passed over. NotFound: no such folder.
Result<std::vector<std::filesystem::path>> images_in(const std::filesystem::path& folder);

}  // namespace flamefield
