#pragma once

#include <filesystem>

#include "proto/volume.h"
#include "services/report/picture.h"

namespace flamefield {

// Writes a .png that has just been drawn, making the folder if need be; ends the command when either fails.
void write_picture(const std::filesystem::path& path, Result<RgbImage> picture);

// Draws a volume into a .png, making the folder if need be; ends the command when that fails.
void write_volume_picture(const std::filesystem::path& path, const Volume& volume,
                          const VolumePictureOptions& options);

}  // namespace flamefield
