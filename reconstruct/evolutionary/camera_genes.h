#pragma once

#include <array>
#include <span>
#include <vector>

#include "proto/camera.h"
#include "proto/volume.h"
#include "reconstruct/random.h"

namespace flamefield {

// The part of a chromosome that is about one camera: small corrections of its pose and its intrinsics. Each
// gene counts in pixels: how far it moves the image of a point of the domain, about.
struct CameraGenes {
  enum Gene : std::size_t { Yaw, Pitch, Roll, Right, Down, Forward, Focal, CentreX, CentreY };
  static constexpr std::size_t kCount = 9;
  std::array<double, kCount> px = {};
};

// The camera with its genes applied.
Camera corrected(const Camera& camera, const CameraGenes& genes, const Grid& domain);

// Cameras and field may move together without any image changing. Takes out of `cameras` the common rigid
// motion and growth that best explains how they differ from `trusted`, by least squares over the images of
// points of the domain.
void keep_gauge(std::span<Camera> cameras, std::span<const Camera> trusted, const Grid& domain);

// Mean distance over the domain, px, between where two cameras see its points.
double mean_shift_px(const Camera& a, const Camera& b, const Grid& domain);

}  // namespace flamefield
