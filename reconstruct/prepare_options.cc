#include "reconstruct/prepare.h"

namespace flamefield {

std::vector<SettingField> fields_of(PrepareOptions& o) {
  return {{"level", "", 0, 1,
           "resample once into level, undistorted cameras; false: cut and merge sensor pixels", &o.level},
          {"binning", "px", 0, 64, "sensor pixels a pixel is wide; 0: about one voxel", &o.binning},
          {"margin_px", "px", 0, 10000, "kept around the projected box", &o.margin_px},
          {"hot_pixel_sigma", "", 0.1, 1e6, "robust deviations of a dark pixel that is repaired",
           &o.hot_pixel_sigma},
          {"counts_per_unit", "", 1e-30, 1e30, "grey levels per (field unit x mm)", &o.counts_per_unit},
          {"clip_negative", "", 0, 1, "set negative pixels to zero", &o.clip_negative},
          {"equal_views", "", 0, 1, "scale the views to one total emission", &o.equal_views},
          {"every", "", 1, 1e9, "average every k-th pulse of a burst", &o.phase.every},
          {"first", "", 0, 1e9, "the first pulse of those, from 0", &o.phase.first},
          {"phase_hz", "Hz", 0, 1e9, "average pulses of one phase of this frequency; 0: of all",
           &o.phase.frequency_hz},
          {"phase_bins", "", 1, 10000, "phases in a period", &o.phase.bins},
          {"phase_bin", "", 0, 9999, "the phase to average", &o.phase.bin}};
}

Result<PrepareOptions> prepare_options(const Recipe& recipe) {
  PrepareOptions options;
  const auto fields = fields_of(options);
  if (auto ok = read_settings("prepare", fields, recipe); !ok) return tl::unexpected(ok.error());
  return options;
}

}  // namespace flamefield
