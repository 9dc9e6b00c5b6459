#include "reconstruct/prepare.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace flamefield {

std::vector<SettingField> fields_of(PrepareOptions& o) {
  return {{"binning", "px", 0, 64, "pixels merged per side; 0: a pixel about as wide as a voxel", &o.binning},
          {"margin_px", "px", 0, 10000, "kept around the projected box", &o.margin_px},
          {"hot_pixel_sigma", "", 0.1, 1e6, "robust deviations of a dark pixel that is repaired",
           &o.hot_pixel_sigma},
          {"counts_per_unit", "", 1e-30, 1e30, "grey levels per (field unit x mm)", &o.counts_per_unit},
          {"clip_negative", "", 0, 1, "set negative pixels to zero", &o.clip_negative}};
}

Result<PrepareOptions> prepare_options(const Recipe& recipe) {
  PrepareOptions options;
  const auto fields = fields_of(options);
  if (auto ok = read_settings("prepare", fields, recipe); !ok) return tl::unexpected(ok.error());
  return options;
}

Result<CameraImages> mean_images(const std::vector<FrameSet>& sets) {
  std::map<std::string, std::pair<std::vector<double>, int>> sums;
  CameraImages out;
  for (const FrameSet& set : sets)
    for (const Frame& frame : set.frames) {
      const auto image = grey_levels(frame);
      if (!image) return tl::unexpected(image.error());
      auto& [sum, count] = sums[frame.camera];
      Image& mean = out[frame.camera];
      if (count == 0) mean = Image(image->width_px, image->height_px);
      if (image->width_px != mean.width_px || image->height_px != mean.height_px) {
        return invalid_input(concat("camera ", frame.camera, ", pulse ", frame.pulse, ": ", image->width_px,
                                    "x", image->height_px, " px"),
                             concat("earlier frames had ", mean.width_px, "x", mean.height_px),
                             "average one capture at a time");
      }
      sum.resize(image->pixels.size(), 0);
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += image->pixels[i];
      ++count;
    }
  for (auto& [camera, image] : out) {
    const auto& [sum, count] = sums[camera];
    for (std::size_t i = 0; i < sum.size(); ++i) image.pixels[i] = static_cast<float>(sum[i] / count);
  }
  return out;
}

namespace {

struct Window {
  int x0 = 0, y0 = 0;
};

// Bounding box in the image of points spread over the domain; the lens bends its edges.
cv::Rect2d projected_box(const Camera& camera, const Grid& domain) {
  constexpr int kPoints = 9;
  const Eigen::Vector3d lower = domain.lower_mm(), size = domain.upper_mm() - lower;
  double x0 = INFINITY, x1 = -INFINITY, y0 = INFINITY, y1 = -INFINITY;
  for (int i = 0; i < kPoints * kPoints * kPoints; ++i) {
    const Eigen::Vector3d f =
        Eigen::Vector3d(i % kPoints, i / kPoints % kPoints, i / kPoints / kPoints) / (kPoints - 1);
    const auto pixel = project(camera, lower + f.cwiseProduct(size));
    if (!pixel) continue;
    x0 = std::min(x0, pixel->x()), x1 = std::max(x1, pixel->x());
    y0 = std::min(y0, pixel->y()), y1 = std::max(y1, pixel->y());
  }
  return {x0, y0, x1 - x0, y1 - y0};
}

// Pixels a voxel covers in the middle of the domain, mean over the cameras.
int binning_for(const std::vector<Camera>& cameras, const Grid& domain) {
  const Eigen::Vector3d centre = 0.5 * (domain.lower_mm() + domain.upper_mm());
  double sum = 0;
  for (const Camera& c : cameras) {
    const double depth_mm = (c.camera_from_world * centre).z();
    sum += depth_mm > 0 ? std::sqrt(c.fx_px * c.fy_px) * domain.spacing_mm.mean() / depth_mm : 1;
  }
  return std::max(1, static_cast<int>(std::lround(sum / static_cast<double>(cameras.size()))));
}

Result<const Image*> image_of(const CameraImages& images, std::string_view what, const Camera& camera) {
  const auto found = images.find(camera.name);
  if (found == images.end()) {
    return invalid_input(concat("no ", what, " image of camera ", camera.name),
                         concat("other cameras have one"),
                         concat("capture ", what, " again with all cameras"));
  }
  const Image& image = found->second;
  if (image.width_px != camera.image_width_px || image.height_px != camera.image_height_px) {
    return invalid_input(
        concat(what, " image of camera ", camera.name, " has ", image.width_px, "x", image.height_px, " px"),
        concat("the rig says ", camera.image_width_px, "x", camera.image_height_px),
        "use the rig of this array, without cropping");
  }
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    if (std::isfinite(image.pixels[i])) continue;
    const auto width = static_cast<std::size_t>(image.width_px);
    return invalid_input(concat(what, " image of camera ", camera.name, ": ", image.pixels[i], " at row ",
                                i / width, ", column ", i % width),
                         "every value must be finite", "capture it again");
  }
  return &image;
}

cv::Mat cut(const Image& image, const Window& window, cv::Size size) {
  const cv::Mat whole(image.height_px, image.width_px, CV_32F, const_cast<float*>(image.pixels.data()));
  return whole(cv::Rect({window.x0, window.y0}, size)).clone();
}

// Pixels whose dark level stands out from the median of their neighbourhood, against the robust spread
// (1.4826 median absolute deviations, at least a quarter grey level) of all.
cv::Mat hot_pixels(const cv::Mat& dark, double sigmas) {
  cv::Mat median;
  cv::medianBlur(dark, median, 5);
  cv::Mat difference = dark - median;
  std::vector<float> deviations(difference.begin<float>(), difference.end<float>());
  for (float& d : deviations) d = std::abs(d);
  const auto middle = deviations.begin() + static_cast<std::ptrdiff_t>(deviations.size() / 2);
  std::nth_element(deviations.begin(), middle, deviations.end());
  const double spread = std::max(1.4826 * static_cast<double>(*middle), 0.25);
  return cv::abs(difference) > sigmas * spread;
}

// Each marked pixel becomes the median of its unmarked neighbours.
int repair(cv::Mat& image, const cv::Mat& marked) {
  const cv::Mat before = image.clone();
  int count = 0;
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x) {
      if (!marked.at<std::uint8_t>(y, x)) continue;
      ++count;
      std::vector<float> near;
      for (int j = std::max(y - 1, 0); j <= std::min(y + 1, image.rows - 1); ++j)
        for (int i = std::max(x - 1, 0); i <= std::min(x + 1, image.cols - 1); ++i)
          if (!marked.at<std::uint8_t>(j, i)) near.push_back(before.at<float>(j, i));
      if (near.empty()) continue;
      const auto middle = near.begin() + static_cast<std::ptrdiff_t>(near.size() / 2);
      std::nth_element(near.begin(), middle, near.end());
      image.at<float>(y, x) = *middle;
    }
  return count;
}

// Response relative to its mean; where a twentieth of it or less is left, division would only raise noise.
void divide_by_flat(cv::Mat& image, const cv::Mat& flat) {
  const double mean = cv::mean(flat)[0];
  if (!(mean > 0)) return;
  cv::Mat response = flat / mean;
  image.setTo(0, response <= 0.05);
  image /= cv::max(response, 0.05);
}

// One size for all windows: the largest projected box with its margin, in whole merged pixels.
cv::Size window_size(const std::vector<Camera>& cameras, const Grid& domain, double margin_px, int binning) {
  int width = 0, height = 0, sensor_width = cameras.front().image_width_px,
      sensor_height = cameras.front().image_height_px;
  const auto whole = [&](double px) {
    return static_cast<int>(std::ceil((px + 1 + 2 * margin_px) / binning)) * binning;
  };
  for (const Camera& camera : cameras) {
    const cv::Rect2d box = projected_box(camera, domain);
    width = std::max(width, whole(std::clamp(box.width, 0.0, 1e6)));
    height = std::max(height, whole(std::clamp(box.height, 0.0, 1e6)));
    sensor_width = std::min(sensor_width, camera.image_width_px);
    sensor_height = std::min(sensor_height, camera.image_height_px);
  }
  return {std::min(width, sensor_width / binning * binning),
          std::min(height, sensor_height / binning * binning)};
}

Window window_of(const Camera& camera, const Grid& domain, cv::Size size) {
  const cv::Rect2d box = projected_box(camera, domain);
  const auto first = [](double centre, int length, int sensor) {
    const double start = std::isfinite(centre) ? std::round(centre - 0.5 * (length - 1)) : 0;
    return static_cast<int>(std::clamp(start, 0.0, static_cast<double>(sensor - length)));
  };
  return {first(box.x + 0.5 * box.width, size.width, camera.image_width_px),
          first(box.y + 0.5 * box.height, size.height, camera.image_height_px)};
}

}  // namespace

Result<Prepared> prepare(const CameraImages& flame, const CameraImages& dark, const CameraImages& background,
                         const CameraImages& flat, const Rig& rig, const Grid& domain,
                         const PrepareOptions& options) {
  if (auto ok = validate(rig); !ok) return tl::unexpected(ok.error());
  if (auto ok = validate(domain); !ok) return tl::unexpected(ok.error());
  if (flame.empty()) return invalid_input("no flame images", "nothing to prepare", "capture a burst first");
  for (const auto& [name, image] : flame) {
    if (!rig.find(name)) {
      return invalid_input(concat("camera ", name, " is not in the rig"), "its pose is unknown",
                           "calibrate it or leave its images out");
    }
  }
  std::vector<Camera> cameras;
  for (const Camera& camera : rig.cameras)
    if (flame.contains(camera.name)) cameras.push_back(camera);

  const int binning = options.binning > 0 ? options.binning : binning_for(cameras, domain);
  const cv::Size size = window_size(cameras, domain, options.margin_px, binning);
  if (size.width < binning || size.height < binning) {
    return invalid_input(concat("binning of ", binning, " px"), "larger than the images",
                         "set a smaller prepare.binning");
  }
  Prepared out;
  out.projections.rows = size.height / binning;
  out.projections.cols = size.width / binning;
  int repaired = 0, clipped = 0;
  for (const Camera& camera : cameras) {
    const Window window = window_of(camera, domain, size);
    const auto cut_of = [&](const CameraImages& images, std::string_view what) -> Result<cv::Mat> {
      const auto image = image_of(images, what, camera);
      if (!image) return tl::unexpected(image.error());
      return cut(**image, window, size);
    };
    auto signal = cut_of(flame, "flame");
    if (!signal) return tl::unexpected(signal.error());
    cv::Mat dark_level = cv::Mat::zeros(size, CV_32F), marked;
    if (!dark.empty()) {
      auto image = cut_of(dark, "dark");
      if (!image) return tl::unexpected(image.error());
      dark_level = *image;
      marked = hot_pixels(dark_level, options.hot_pixel_sigma);
    }
    cv::Mat offset = dark_level;  // a background picture contains the dark level
    if (!background.empty()) {
      auto image = cut_of(background, "background");
      if (!image) return tl::unexpected(image.error());
      offset = *image;
    }
    *signal -= offset;
    if (!flat.empty()) {
      auto image = cut_of(flat, "flat");
      if (!image) return tl::unexpected(image.error());
      divide_by_flat(*signal, *image - dark_level);
    }
    if (!marked.empty()) repaired += repair(*signal, marked);
    cv::Mat merged;
    cv::resize(*signal, merged, {size.width / binning, size.height / binning}, 0, 0, cv::INTER_AREA);
    merged /= options.counts_per_unit;
    if (options.clip_negative) {
      clipped += cv::countNonZero(merged < 0);
      merged = cv::max(merged, 0);
    }
    out.projections.view_names.push_back(camera.name);
    out.projections.values.insert(out.projections.values.end(), merged.begin<float>(), merged.end<float>());
    out.rig.cameras.push_back(
        cropped_and_binned(camera, window.x0, window.y0, size.width, size.height, binning));
  }
  if (!background.empty()) {
    out.provenance.push_back("background subtracted (it contains the dark level)");
  } else if (!dark.empty()) {
    out.provenance.push_back("dark subtracted");
  }
  if (!flat.empty()) out.provenance.push_back("divided by the flat field, its mean set to 1");
  if (!dark.empty()) {
    out.provenance.push_back(concat("hot pixels: ", repaired, " repaired (dark level beyond ",
                                    options.hot_pixel_sigma,
                                    " robust deviations), median of their neighbours"));
  }
  out.provenance.push_back(concat("cut to ", size.width, "x", size.height, " px around the domain, margin ",
                                  options.margin_px, " px; views: ", cameras.size(), " of ",
                                  rig.cameras.size()));
  out.provenance.push_back(concat("merged ", binning, "x", binning, " px by area to ", out.projections.cols,
                                  "x", out.projections.rows));
  out.provenance.push_back(
      concat("divided by ", options.counts_per_unit, " grey levels per (field unit x mm)"));
  if (options.clip_negative)
    out.provenance.push_back(concat("negative values set to zero: ", clipped, " pixels"));
  return out;
}

}  // namespace flamefield
