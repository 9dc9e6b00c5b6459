#include "services/store/rig_export.h"

#include <Eigen/Geometry>
#include <iomanip>
#include <sstream>

#include "services/store/file.h"

namespace flamefield {

namespace {

constexpr double kMetrePerMm = 1e-3;

std::ostringstream precise_stream() {
  std::ostringstream out;
  out << std::setprecision(17);
  return out;
}

Result<> make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!error) return {};
  return invalid_input(concat("cannot make folder '", folder.string(), "'"), error.message(),
                       "choose another output");
}

}  // namespace

Result<> export_colmap(const std::filesystem::path& folder, const Rig& rig) {
  auto cameras = precise_stream(), images = precise_stream();
  cameras << "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n";
  images << "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then the image's points (none); lengths in mm\n";
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const Camera& c = rig.cameras[i];
    const auto& d = c.distortion;
    cameras << i + 1 << (d[4] == 0 ? " OPENCV " : " FULL_OPENCV ") << c.image_width_px << ' '
            << c.image_height_px << ' ' << c.fx_px << ' ' << c.fy_px << ' ' << c.cx_px + 0.5 << ' '
            << c.cy_px + 0.5 << ' ' << d[0] << ' ' << d[1] << ' ' << d[2] << ' ' << d[3];
    if (d[4] != 0) cameras << ' ' << d[4] << " 0 0 0";
    cameras << '\n';
    const Eigen::Quaterniond q(c.camera_from_world.rotation);
    const Eigen::Vector3d& t = c.camera_from_world.translation_mm;  // COLMAP wants single spaces
    images << i + 1 << ' ' << q.w() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << ' ' << t.x() << ' '
           << t.y() << ' ' << t.z() << ' ' << i + 1 << ' ' << c.name << "\n\n";
  }
  if (auto ok = make_folder(folder); !ok) return ok;
  if (auto ok = write_text_file(folder / "cameras.txt", cameras.str()); !ok) return ok;
  if (auto ok = write_text_file(folder / "images.txt", images.str()); !ok) return ok;
  return write_text_file(folder / "points3D.txt", "# no points\n");
}

Result<> export_kalibr(const std::filesystem::path& path, const Rig& rig) {
  auto out = precise_stream();
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const Camera& c = rig.cameras[i];
    const auto& d = c.distortion;
    if (d[4] != 0) {
      return invalid_input(concat("camera '", c.name, "' has k3 = ", d[4]),
                           "Kalibr's radtan lens has k1 k2 p1 p2",
                           "calibrate with k3 = 0 or export to COLMAP");
    }
    out << "cam" << i << ":\n  camera_model: pinhole\n  intrinsics: [" << c.fx_px << ", " << c.fy_px << ", "
        << c.cx_px << ", " << c.cy_px << "]\n  distortion_model: radtan\n  distortion_coeffs: [" << d[0]
        << ", " << d[1] << ", " << d[2] << ", " << d[3] << "]\n  resolution: [" << c.image_width_px << ", "
        << c.image_height_px << "]\n  rostopic: /" << c.name << "/image_raw\n";
    if (i == 0) continue;
    // T_cn_cnm1: this camera from the one before.
    const Rigid3 motion = c.camera_from_world * rig.cameras[i - 1].camera_from_world.inverse();
    out << "  T_cn_cnm1:\n";
    for (int row = 0; row < 3; ++row) {
      out << "  - [" << motion.rotation(row, 0) << ", " << motion.rotation(row, 1) << ", "
          << motion.rotation(row, 2) << ", " << motion.translation_mm[row] * kMetrePerMm << "]\n";
    }
    out << "  - [0.0, 0.0, 0.0, 1.0]\n";
  }
  return write_text_file(path, out.str());
}

Result<> export_mrcal(const std::filesystem::path& path, const Rig& rig) {
  for (const Camera& c : rig.cameras) {
    auto out = precise_stream();
    const Eigen::AngleAxisd turn(c.camera_from_world.rotation);
    const Eigen::Vector3d r = turn.angle() * turn.axis(),
                          t = c.camera_from_world.translation_mm * kMetrePerMm;
    out << "# " << c.name << "\n{\n  'lensmodel': 'LENSMODEL_OPENCV5',\n  'intrinsics': [ " << c.fx_px << ", "
        << c.fy_px << ", " << c.cx_px << ", " << c.cy_px;
    for (double k : c.distortion) out << ", " << k;
    out << " ],\n  'extrinsics': [ " << r[0] << ", " << r[1] << ", " << r[2] << ", " << t[0] << ", " << t[1]
        << ", " << t[2] << " ],\n  'imagersize': [ " << c.image_width_px << ", " << c.image_height_px
        << " ],\n}\n";
    auto target = path;
    target.replace_filename(concat(path.stem().string(), "-", c.name, ".cameramodel"));
    if (auto ok = write_text_file(target, out.str()); !ok) return ok;
  }
  return {};
}

}  // namespace flamefield
