#pragma once

#include <filesystem>

#include "proto/volume.h"
#include "services/report/picture.h"

namespace flamefield {

// Draws a volume into a .png, making the folder if need be; ends the command when that fails.
void write_volume_picture(const std::filesystem::path& path, const Volume& volume,
                          const VolumePictureOptions& options);

}  // namespace flamefield
