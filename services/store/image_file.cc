#include "services/store/image_file.h"

#include <algorithm>
#include <cctype>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "services/store/file.h"

namespace flamefield {

namespace {

bool is_picture(const std::filesystem::path& path) {
  static const std::set<std::string> kExtensions = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm"};
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return kExtensions.count(extension) > 0;
}

tl::unexpected<Error> no_picture(const std::filesystem::path& path, std::string_view why) {
  return invalid_input(concat("cannot read '", path.string(), "'"), why, "save it as .png again");
}

}  // namespace

Result<Image> read_grey_image(const std::filesystem::path& path) {
  const auto bytes = read_text_file(path, 1u << 30);
  if (!bytes) return tl::unexpected(bytes.error());
  if (bytes->empty()) return no_picture(path, "it is empty");
  try {
    const cv::Mat encoded(1, static_cast<int>(bytes->size()), CV_8U, const_cast<char*>(bytes->data()));
    const cv::Mat decoded = cv::imdecode(encoded, cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH);
    if (decoded.empty()) return no_picture(path, "not a picture, or damaged");
    Image image(decoded.cols, decoded.rows);
    const cv::Mat pixels(image.height_px, image.width_px, CV_32F, image.pixels.data());
    decoded.convertTo(pixels, CV_32F);
    return image;
  } catch (const cv::Exception& exception) {
    return no_picture(path, exception.err);
  }
}

Result<std::vector<std::filesystem::path>> images_in(const std::filesystem::path& folder) {
  std::error_code error;
  std::vector<std::filesystem::path> paths;
  for (std::filesystem::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    if (it->is_regular_file() && is_picture(it->path())) paths.push_back(it->path());
  if (error)
    return not_found(concat("cannot read folder '", folder.string(), "'"), error.message(), "check the path");
  std::sort(paths.begin(), paths.end());
  return paths;
}

}  // namespace flamefield
