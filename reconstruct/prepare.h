#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "proto/frame.h"
#include "proto/image.h"
#include "proto/recipe.h"
#include "proto/rig.h"
#include "proto/volume.h"
#include "reconstruct/settings.h"

namespace flamefield {

// From sensor grey levels to projections: average the dark, background and flame frames of each camera;
// subtract; divide by the flat field; repair hot pixels; cut out what sees the measuring volume; merge pixels
// by area; clip below zero. Table [prepare] of a recipe.
struct PrepareOptions {
  int binning = 0;       // px merged per side; 0: so that a pixel is about one voxel wide
  double margin_px = 4;  // kept around the projected box, sensor pixels
  double hot_pixel_sigma =
      8;  // a dark frame's pixel this many robust deviations off its neighbours is repaired
  double counts_per_unit = 1;  // grey levels per (field unit x mm)
  bool clip_negative = true;
};
Result<PrepareOptions> prepare_options(const Recipe& recipe);  // unknown [prepare] keys are errors

std::vector<SettingField> fields_of(PrepareOptions& options);

// Mean grey levels by camera name.
using CameraImages = std::map<std::string, Image>;

struct Prepared {
  Projections projections;  // one view per camera of `rig`
  Rig rig;                  // the cameras as seen through crop and binning; missing cameras left out
  std::vector<std::string> provenance;  // one line per step, with its numbers
};

// flame: the images to reconstruct. dark/background/flat may be empty. InvalidInput names a camera that is in
// the images but not in the rig, a size mismatch, or NaN.
Result<Prepared> prepare(const CameraImages& flame, const CameraImages& dark, const CameraImages& background,
                         const CameraImages& flat, const Rig& rig, const Grid& domain,
                         const PrepareOptions& options);

// Mean of the frames of each camera over the sets. InvalidInput when a frame's bytes do not match its size.
Result<CameraImages> mean_images(const std::vector<FrameSet>& sets);

}  // namespace flamefield
