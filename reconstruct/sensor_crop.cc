#include "reconstruct/sensor_crop.h"

#include <algorithm>
#include <cmath>

namespace flamefield {

namespace {

struct Box {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(INFINITY), high = -low;
  Eigen::Vector2d size() const { return high - low; }
  Eigen::Vector2d middle() const { return 0.5 * (low + high); }
};

// Bounding box in the image of points spread over the domain; the lens bends its edges.
Box projected_box(const Camera& camera, const Grid& domain) {
  constexpr int kPoints = 9;
  const Eigen::Vector3d lower = domain.lower_mm(), size = domain.upper_mm() - lower;
  Box box;
  for (int i = 0; i < kPoints * kPoints * kPoints; ++i) {
    const Eigen::Vector3d f =
        Eigen::Vector3d(i % kPoints, i / kPoints % kPoints, i / kPoints / kPoints) / (kPoints - 1);
    const auto pixel = project(camera, lower + f.cwiseProduct(size));
    if (!pixel) continue;
    box.low = box.low.cwiseMin(*pixel);
    box.high = box.high.cwiseMax(*pixel);
  }
  return box;
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

}  // namespace

Result<SensorCrops> sensor_crops(const std::vector<Camera>& sensors, const Grid& domain, int binning,
                                 double margin_px) {
  SensorCrops out;
  const int b = out.binning = binning > 0 ? binning : binning_for(sensors, domain);
  const auto whole = [&](double px) {
    return static_cast<int>(std::ceil((std::clamp(px, 0.0, 1e6) + 1 + 2 * margin_px) / b)) * b;
  };
  int width = 0, height = 0;
  std::vector<Box> boxes;
  for (const Camera& camera : sensors) {
    boxes.push_back(projected_box(camera, domain));
    width = std::max(width, whole(boxes.back().size().x()));
    height = std::max(height, whole(boxes.back().size().y()));
  }
  for (const Camera& camera : sensors) {
    width = std::min(width, camera.image_width_px / b * b);
    height = std::min(height, camera.image_height_px / b * b);
  }
  if (width < b || height < b) {
    return invalid_input(concat("binning of ", b, " px"), "larger than the images",
                         "set a smaller prepare.binning");
  }
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    const auto first = [](double centre, int length, int sensor) {
      const double start = std::isfinite(centre) ? std::round(centre - 0.5 * (length - 1)) : 0;
      return static_cast<int>(std::clamp(start, 0.0, static_cast<double>(sensor - length)));
    };
    const Window window{first(boxes[i].middle().x(), width, sensors[i].image_width_px),
                        first(boxes[i].middle().y(), height, sensors[i].image_height_px), width, height};
    out.windows.push_back(window);
    out.cameras.push_back(cropped_and_binned(sensors[i], window.x0, window.y0, width, height, b));
  }
  return out;
}

}  // namespace flamefield
