#include "services/report/rgb_image.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "proto/check.h"
#include "services/store/file.h"

namespace flamefield {

ValueRange emission_range(const std::vector<float>& values) {
  float high = 0;
  for (float v : values) {
    if (std::isfinite(v)) high = std::max(high, v);
  }
  return {0, high > 0 ? high : 1};
}

RgbImage coloured(const Image& image, const ColourMap& map, ValueRange range) {
  RgbImage out(image.width_px, image.height_px);
  std::uint8_t* byte = out.bytes.data();
  for (float v : image.pixels) {
    const Rgb colour = colour_of(map, v, range.low, range.high);
    byte = std::copy(colour.begin(), colour.end(), byte);
  }
  return out;
}

Image resized(const Image& image, int width_px, int height_px) {
  expect(image.width_px > 0 && image.height_px > 0, "an image to resize has pixels");
  expect(width_px > 0 && height_px > 0, "the new size is positive");
  Image out(width_px, height_px);
  const cv::Mat from(image.height_px, image.width_px, CV_32FC1, const_cast<float*>(image.pixels.data()));
  cv::Mat to(height_px, width_px, CV_32FC1, out.pixels.data());
  const bool smaller = width_px < image.width_px || height_px < image.height_px;
  cv::resize(from, to, to.size(), 0, 0, smaller ? cv::INTER_AREA : cv::INTER_CUBIC);
  return out;
}

std::string png_from(const RgbImage& image) {
  expect(image.width_px > 0 && image.height_px > 0, "a PNG has at least one pixel");
  const cv::Mat rgb(image.height_px, image.width_px, CV_8UC3, const_cast<std::uint8_t*>(image.bytes.data()));
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<std::uint8_t> png;
  cv::imencode(".png", bgr, png, {cv::IMWRITE_PNG_COMPRESSION, 6});
  return {png.begin(), png.end()};
}

Result<RgbImage> rgb_from_png(const std::string& png) {
  const cv::Mat bytes(1, static_cast<int>(png.size()), CV_8UC1, const_cast<char*>(png.data()));
  const cv::Mat bgr = png.empty() ? cv::Mat() : cv::imdecode(bytes, cv::IMREAD_COLOR);
  if (bgr.empty()) {
    return invalid_input("image bytes", "they are not a PNG", "check what wrote them");
  }
  RgbImage out(bgr.cols, bgr.rows);
  cv::Mat rgb(bgr.rows, bgr.cols, CV_8UC3, out.bytes.data());
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  return out;
}

Result<> write_png(const std::filesystem::path& path, const RgbImage& image) {
  return write_text_file(path, png_from(image));
}

}  // namespace flamefield
