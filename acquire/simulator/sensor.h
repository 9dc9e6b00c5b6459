#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/frame.h"
#include "proto/image.h"

namespace flamefield {

// A CCD like the one in the acA645-100gm: photo-electrons -> grey levels, after the linear camera model of
// EMVA Standard 1288, release 4.0, section 2: level = dark + K (electrons + noise), cut at full well.
struct SensorModel {
  double full_well_e = 18000;        // fills all 4095 levels of 12 bits at GainRaw 0
  double read_noise_e = 10;          // sigma, per read
  bool has_shot_noise = true;        // Poisson, approximated by a Gaussian of the same variance
  double dark_level_dn12 = 64;       // grey level of no light, of 4095, plus BlackLevelRaw
  double vignetting = 0.12;          // fraction of light lost in the corners, falling as radius^2
  double hot_pixel_fraction = 2e-4;  // of all pixels
  double hot_pixel_e = 2000;         // mean dark charge of a hot pixel in kSceneExposure_us
  double gain_db_per_raw_step = 0.0359;

  // No noise, no shading, no defects: a pixel of n electrons reads n levels of 12 bits.
  static SensorModel ideal();
};

// One sensor with its own pattern of defects. The same seed, camera and pulse give the same picture.
class Sensor {
 public:
  Sensor(const SensorModel& model, int width_px, int height_px, std::uint64_t seed);

  struct Readout {
    PixelFormat format = PixelFormat::Mono8;
    int offset_x_px = 0, offset_y_px = 0;  // region of interest
    int width_px = 0, height_px = 0;
    int binning_x = 1,
        binning_y = 1;  // sensor pixels whose charges are added; the region counts binned pixels
    double exposure_us = 0;
    int gain_raw = 0;
    int black_level_raw = 0;  // in levels of 12 bits
  };
  // `light`: photo-electrons at kSceneExposure_us, of the whole sensor's size (else it counts as dark), or
  // null. Returns bytes_of_image(...) bytes, as they go on the wire.
  std::vector<std::uint8_t> expose(const Image* light, const Readout& readout, std::int64_t pulse) const;

 private:
  SensorModel model_;
  int width_px_, height_px_;
  std::uint64_t seed_;
  std::vector<float> vignetting_;  // (rows, cols), share of light that arrives
  std::vector<float> dark_e_;      // (rows, cols), dark charge in kSceneExposure_us
  std::vector<float> normals_;     // quantiles of the standard normal distribution
};

}  // namespace flamefield
