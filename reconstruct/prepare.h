#pragma once

#include <string>
#include <vector>

#include "proto/image.h"
#include "proto/recipe.h"
#include "proto/rig.h"
#include "proto/volume.h"
#include "reconstruct/area_map.h"
#include "reconstruct/averaging.h"
#include "reconstruct/correction.h"
#include "reconstruct/parallel.h"
#include "reconstruct/settings.h"

namespace flamefield {

// From sensor grey levels to projections: subtract dark or background; divide by the flat field; repair hot
// pixels; average over the pixels of level virtual cameras that see the domain; scale to physical units; clip
// below zero. Table [prepare] of a recipe.
struct PrepareOptions {
  bool level = true;           // false: cut and merge whole sensor pixels, lens and tilt stay in the cameras
  int binning = 0;             // sensor pixels a pixel is wide; 0: about one voxel
  double margin_px = 4;        // kept around the projected box, sensor pixels
  double hot_pixel_sigma = 8;  // a dark frame's pixel this many robust deviations off is repaired
  double counts_per_unit = 1;  // grey levels per (field unit x mm)
  bool clip_negative = true;
  bool equal_views = false;  // scale the views to one total emission, for cameras of unknown gain
  PhaseLock phase = {};      // which sets of a burst the flame images are averaged over
};
Result<PrepareOptions> prepare_options(const Recipe& recipe);  // unknown [prepare] keys are errors

std::vector<SettingField> fields_of(PrepareOptions& options);

struct Prepared {
  Projections projections;              // one view per camera of `rig`
  Rig rig;                              // the cameras of these projections; missing cameras left out
  std::vector<std::size_t> saturated;   // per view: used sensor pixels that reached full scale, less hot ones
  std::vector<std::string> provenance;  // one line per step, with its numbers
};

// Reference images of whole sensors; empty: none.
struct References {
  MeanImages dark = {}, background = {}, flat = {};
};

// Everything that depends on rig, domain and references but not on the flame: made once, applied to every
// pulse. Immutable; may be shared.
class Preparer {
 public:
  // rig: the cameras to prepare, in the order of the views. InvalidInput names a camera that lacks a
  // reference image or has one of another size or with NaN, or one that does not see the domain.
  static Result<Preparer> make(const Rig& rig, const References& references, const Grid& domain,
                               const PrepareOptions& options, Team& team);

  // InvalidInput as above, for flame images. Images of other cameras are ignored.
  Result<Prepared> operator()(const MeanImages& flame, Team& team) const;

  std::size_t views() const { return views_.size(); }
  const Camera& sensor(std::size_t view) const { return views_[view].sensor; }
  const Camera& camera(std::size_t view) const { return views_[view].camera; }
  const AreaMap& map(std::size_t view) const { return views_[view].map; }
  // The used window of a view with offset, gain and hot pixels corrected, in grey levels; `raw` is of the
  // sensor's size.
  Image corrected(std::size_t view, const Image& raw) const;

 private:
  struct View {
    Camera sensor, camera;
    AreaMap map;
    std::vector<SensorCorrection> correction;  // exactly one, once known
  };
  Preparer() = default;
  Result<> make_level(const std::vector<Camera>& sensors, const Grid& domain, Team& team);
  Result<> make_crops(const std::vector<Camera>& sensors, const Grid& domain);
  Result<> shrink_to_sensors();
  static std::size_t saturated_in(const MeanImages& images, const View& view);
  void describe_references(const References& references);

  PrepareOptions options_;
  Grid domain_;
  std::vector<View> views_;
  std::vector<std::string> corrections_, geometry_;  // provenance
};

// The rig's cameras that have a flame image. InvalidInput names a camera that the rig lacks.
Result<Rig> rig_of_images(const Rig& rig, const CameraImages& flame);

// All at once, for a single use.
Result<Prepared> prepare(const MeanImages& flame, const References& references, const Rig& rig,
                         const Grid& domain, const PrepareOptions& options);

}  // namespace flamefield
