#include "proto/rig.h"

#include <set>

#include "proto/fingerprint.h"

namespace flamefield {

std::optional<std::size_t> Rig::find(std::string_view camera_name) const {
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].name == camera_name) return i;
  }
  return std::nullopt;
}

Result<> validate(const Rig& rig) {
  if (rig.cameras.empty()) {
    return invalid_input("the rig has no cameras", "nothing can be projected", "list them under 'cameras'");
  }
  std::set<std::string> names;
  for (const Camera& camera : rig.cameras) {
    if (camera.name.empty()) {
      return invalid_input("a camera of the rig has no name", "images are matched by it", "add 'name'");
    }
    if (!names.insert(camera.name).second) {
      return invalid_input("camera name '" + camera.name + "' appears twice", "names must be unique",
                           "rename one");
    }
    if (auto ok = validate(camera); !ok) return ok;
  }
  if (rig.quality && rig.quality->cameras.size() != rig.cameras.size()) {
    return invalid_input(
        concat("quality of ", rig.quality->cameras.size(), " cameras for a rig of ", rig.cameras.size()),
        "one entry per camera", "calibrate again");
  }
  return {};
}

std::string fingerprint(const Rig& rig) {
  Fingerprint print;
  for (const Camera& c : rig.cameras) {
    print.add(c.name);
    print.add(c.image_width_px);
    print.add(c.image_height_px);
    for (double v : {c.fx_px, c.fy_px, c.cx_px, c.cy_px}) print.add(v);
    for (double v : c.distortion) print.add(v);
    for (int row = 0; row < 3; ++row) {
      for (int col = 0; col < 3; ++col) print.add(c.camera_from_world.rotation(row, col));
      print.add(c.camera_from_world.translation_mm(row));
    }
  }
  return print.text();
}

}  // namespace flamefield
