#include "services/report/colour_map.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace flamefield {
namespace {

ColourMap from_opencv(cv::ColormapTypes type) {
  cv::Mat ramp(1, 256, CV_8UC1);
  for (int i = 0; i < 256; ++i) ramp.at<std::uint8_t>(0, i) = static_cast<std::uint8_t>(i);
  cv::Mat bgr;
  cv::applyColorMap(ramp, bgr, type);
  ColourMap map;
  for (int i = 0; i < 256; ++i) {
    const cv::Vec3b c = bgr.at<cv::Vec3b>(0, i);
    map[static_cast<std::size_t>(i)] = {c[2], c[1], c[0]};
  }
  return map;
}

// Msh is CIELAB in polar form: M = |Lab|, s = acos(L / M), h = atan2(b, a) (Moreland 2009, Sec. 4).
Rgb rgb_from_msh(double m, double s, double h) {
  cv::Mat lab(1, 1, CV_32FC3,
              cv::Scalar(m * std::cos(s), m * std::sin(s) * std::cos(h), m * std::sin(s) * std::sin(h)));
  cv::Mat rgb;
  cv::cvtColor(lab, rgb, cv::COLOR_Lab2RGB);
  const cv::Vec3f c = rgb.at<cv::Vec3f>(0, 0);
  const auto byte = [](float v) {
    return static_cast<std::uint8_t>(std::lround(255 * std::clamp(v, 0.0f, 1.0f)));
  };
  return {byte(c[0]), byte(c[1]), byte(c[2])};
}

ColourMap diverging() {
  // End points of Moreland's cool-warm map; the hue of each arm turns by 0.5 to 0.6 rad towards white.
  const Eigen::Vector3d cool(80, 1.08, -1.1), cool_white(88, 0, -1.661);
  const Eigen::Vector3d warm(80, 1.08, 0.5), warm_white(88, 0, 1.061);
  ColourMap map;
  for (std::size_t i = 0; i < map.size(); ++i) {
    const double t = static_cast<double>(i) / 255;
    const Eigen::Vector3d msh = t < 0.5 ? Eigen::Vector3d(cool + 2 * t * (cool_white - cool))
                                        : Eigen::Vector3d(warm_white + (2 * t - 1) * (warm - warm_white));
    map[i] = rgb_from_msh(msh.x(), msh.y(), msh.z());
  }
  return map;
}

}  // namespace

const ColourMap& inferno() {
  static const ColourMap map = from_opencv(cv::COLORMAP_INFERNO);
  return map;
}

const ColourMap& cool_warm() {
  static const ColourMap map = diverging();
  return map;
}

Rgb colour_of(const ColourMap& map, double value, double low, double high) {
  if (std::isnan(value)) return {128, 128, 128};
  const double t = high > low ? (value - low) / (high - low) : 0;
  return map[static_cast<std::size_t>(std::lround(255 * std::clamp(t, 0.0, 1.0)))];
}

}  // namespace flamefield
