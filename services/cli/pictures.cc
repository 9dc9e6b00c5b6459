#include "services/cli/pictures.h"

#include "services/cli/app.h"
#include "services/report/rgb_image.h"

namespace flamefield {

void write_picture(const std::filesystem::path& path, Result<RgbImage> picture) {
  std::error_code ignored;  // writing says it better
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path(), ignored);
  or_fail(write_png(path, or_fail(std::move(picture))));
}

void write_volume_picture(const std::filesystem::path& path, const Volume& volume,
                          const VolumePictureOptions& options) {
  write_picture(path, volume_picture(volume, options));
}

}  // namespace flamefield
