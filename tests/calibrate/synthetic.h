#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "acquire/simulator/true_rig.h"
#include "calibrate/calibrate.h"
#include "calibrate/detect.h"
#include "proto/image.h"

namespace flamefield {

// A calibration session whose truth is known.
struct Session {
  Rig truth;
  std::vector<Rigid3> poses;
  BoardSpec board;
  std::vector<Detection> detections;
  CalibrationOptions options;
};

inline std::string pose_name(std::size_t k) {
  return "pose" + std::to_string(100 + k).substr(1);
}

// The board's true corners in a camera, when it is seen within 60 degrees of its normal and wholly.
inline std::optional<std::vector<Eigen::Vector2d>> true_corners(const Camera& camera, const Rigid3& pose,
                                                                const BoardSpec& board,
                                                                double limit_deg = 60) {
  const Eigen::Vector3d eye = (pose.inverse() * camera.centre_mm()).normalized();
  if (-eye.z() < std::cos(limit_deg * std::numbers::pi / 180)) return std::nullopt;
  std::vector<Eigen::Vector2d> corners;
  for (const Eigen::Vector3d& point : corners_mm(board)) {
    const auto pixel = project(camera, pose * point);
    if (!pixel || pixel->x() < 5 || pixel->y() < 5 || pixel->x() > camera.image_width_px - 6 ||
        pixel->y() > camera.image_height_px - 6) {
      return std::nullopt;
    }
    corners.push_back(*pixel);
  }
  return corners;
}

// Detections of a whole session with Gaussian noise on each corner coordinate.
inline std::vector<Detection> synthetic_session(const Rig& rig, const std::vector<Rigid3>& poses,
                                                const BoardSpec& board, double noise_px, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> noise(0, noise_px > 0 ? noise_px : 1);
  std::vector<Detection> session;
  for (const Camera& camera : rig.cameras) {
    for (std::size_t k = 0; k < poses.size(); ++k) {
      Detection detection{camera.name, pose_name(k), camera.image_width_px, camera.image_height_px, {}, {}};
      if (auto corners = true_corners(camera, poses[k], board)) {
        for (Eigen::Vector2d& corner : *corners) {
          if (noise_px > 0) corner += Eigen::Vector2d(noise(engine), noise(engine));
        }
        detection.corners_px = *corners;
      } else {
        detection.reason = "board not found";
      }
      session.push_back(detection);
    }
  }
  return session;
}

// An 8-bit camera with shot noise and 10 electrons of read noise.
inline Image with_noise(Image image, double full_scale_electrons, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<float> normal;
  for (float& value : image.pixels) {
    const float noisy = value + std::sqrt(std::max(0.0f, value) + 100.0f) * normal(engine);
    value = std::clamp(std::round(noisy / static_cast<float>(full_scale_electrons) * 255), 0.0f, 255.0f);
  }
  return image;
}
}  // namespace flamefield
