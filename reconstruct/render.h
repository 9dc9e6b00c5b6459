#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "proto/image.h"
#include "proto/rig.h"
#include "proto/volume.h"
#include "reconstruct/projector/ray_march.h"

namespace flamefield {

// The paper's ray tracer (Eq. 1): I = sum f_i ds along each pinhole ray, trilinear, clipped to the box.
struct RenderOptions {
  double step_voxels = 0.5;  // ds, in units of the smallest voxel side
  int pixel_samples = 1;     // k x k rays a pixel
  Lens lens = {};            // a pinhole unless it has an aperture
  int threads = 0;           // 0: all
};

// Renders one volume through many cameras: which 8 x 8 x 8 blocks are empty is found out once. The volume
// must outlive it.
class Renderer {
 public:
  explicit Renderer(const Volume& volume);
  Image view(const Camera& camera, const RenderOptions& options) const;  // field unit x mm

 private:
  const Volume& volume_;
  std::array<int, 3> blocks_ = {};
  std::vector<std::uint8_t> occupied_;
  Eigen::Vector3d lit_lower_mm_, lit_upper_mm_;  // box around all occupied blocks
  bool empty_ = true;
};

// One image (field unit x mm) per camera; empty space is skipped.
Image render_view(const Volume& volume, const Camera& camera, const RenderOptions& options);

// All views; the cameras must share one image size. InvalidInput otherwise.
Result<Projections> render(const Volume& volume, const Rig& rig, const RenderOptions& options);

// What a sensor adds to an ideal image: photon shot noise, read noise, quantisation.
struct SensorNoise {
  double photons = 0;     // photons at the brightest pixel of the whole set; 0: no shot noise
  double read_noise = 0;  // standard deviation in photons (electrons)
  int bits = 0;           // quantisation over the full scale; 0: none
  std::uint64_t seed = 1;
};
// InvalidInput: negative or non-finite settings, or read noise without a photon count to measure it by.
Result<> add_noise(Projections& projections, const SensorNoise& noise);

}  // namespace flamefield
