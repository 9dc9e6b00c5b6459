#pragma once

#include <vector>

#include "proto/board.h"
#include "proto/camera.h"
#include "proto/image.h"

namespace flamefield {

// A printed checkerboard on a plate under ordinary room light, as a lens shows it to a sensor.
struct BoardScene {
  BoardSpec board = {};
  std::vector<MarkerPattern> markers = {};  // in the white squares, see marker_centres_mm(); may be empty
  double border_mm = 10;                // white rim around the outer squares
  double white_albedo = 0.80;           // of the paper
  double dark_albedo = 0.08;            // of the ink: never quite black
  double back_albedo = 0.12;            // bare side of the plate
  double background_albedo = 0.04;      // the room behind, seen through the lens
  double full_scale_electrons = 15000;  // what albedo 1, seen squarely, gives a pixel
  double ambient_fraction = 0.4;        // light that does not depend on the viewing angle, 0 to 1
  double light_gradient = 0.2;          // relative change of the light from the plate's middle to its edge
  double defocus_sigma_px = 0.7;        // Gaussian blur
};

// The ideal picture in photo-electrons: perspective, lens distortion, pixel area, defocus and shading, but no
// noise: shot noise, read noise and quantisation are the sensor's. A plate that reaches behind the camera
// shows the background only; from behind, the plate shows no pattern.
Image render_board(const Camera& camera, const Rigid3& world_from_board, const BoardScene& scene);

}  // namespace flamefield
