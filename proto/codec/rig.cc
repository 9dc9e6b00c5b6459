// Cameras and rings.
#include "proto/codec/wire.h"

namespace flamefield {

void write(const Camera& camera, v1::Camera* wire) {
  wire->set_name(camera.name);
  wire->set_image_width_px(camera.image_width_px);
  wire->set_image_height_px(camera.image_height_px);
  wire->set_fx_px(camera.fx_px);
  wire->set_fy_px(camera.fy_px);
  wire->set_cx_px(camera.cx_px);
  wire->set_cy_px(camera.cy_px);
  for (double d : camera.distortion) wire->add_distortion(d);
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) wire->add_rotation(camera.camera_from_world.rotation(row, col));
    wire->add_translation_mm(camera.camera_from_world.translation_mm(row));
  }
}

void read(const v1::Camera& wire, Camera& camera, Check& check) {
  const bool complete =
      wire.distortion_size() == 5 && wire.rotation_size() == 9 && wire.translation_mm_size() == 3;
  check.require(complete, "camera", "needs 5 distortion, 9 rotation and 3 translation numbers");
  check.name(wire.name(), "camera name");
  if (!complete) return;
  camera.name = wire.name();
  camera.image_width_px = wire.image_width_px();
  camera.image_height_px = wire.image_height_px();
  camera.fx_px = wire.fx_px();
  camera.fy_px = wire.fy_px();
  camera.cx_px = wire.cx_px();
  camera.cy_px = wire.cy_px();
  for (int i = 0; i < 5; ++i) camera.distortion[static_cast<std::size_t>(i)] = wire.distortion(i);
  for (int i = 0; i < 9; ++i) camera.camera_from_world.rotation(i / 3, i % 3) = wire.rotation(i);
  for (int i = 0; i < 3; ++i) camera.camera_from_world.translation_mm(i) = wire.translation_mm(i);
}

void write(const CameraQuality& quality, v1::CameraQuality* wire) {
  wire->set_images(quality.images);
  wire->set_corners(quality.corners);
  wire->set_rejected_corners(quality.rejected_corners);
  wire->set_rms_px(quality.rms_px);
  wire->set_focal_sigma_px(quality.focal_sigma_px);
  wire->set_position_sigma_mm(quality.position_sigma_mm);
  wire->set_rotation_sigma_rad(quality.rotation_sigma_rad);
}

void read(const v1::CameraQuality& wire, CameraQuality& quality, Check& check) {
  quality = {wire.images(),         wire.corners(),           wire.rejected_corners(),  wire.rms_px(),
             wire.focal_sigma_px(), wire.position_sigma_mm(), wire.rotation_sigma_rad()};
  for (double v :
       {quality.rms_px, quality.focal_sigma_px, quality.position_sigma_mm, quality.rotation_sigma_rad})
    check.finite(v, "camera quality");
}

void write(const Rig& rig, v1::Rig* wire) {
  write_all(rig.cameras, wire->mutable_cameras());
  if (!rig.quality) return;
  wire->mutable_quality()->set_rms_px(rig.quality->rms_px);
  wire->mutable_quality()->set_board_poses(rig.quality->board_poses);
  write_all(rig.quality->cameras, wire->mutable_quality()->mutable_cameras());
}

void read(const v1::Rig& wire, Rig& rig, Check& check) {
  check.require(wire.cameras_size() <= kMaxCameras && wire.quality().cameras_size() <= kMaxCameras, "rig",
                "more than 256 cameras");
  if (!check.problem().empty()) return;
  read_all(wire.cameras(), rig.cameras, check);
  if (wire.has_quality()) {
    RigQuality& quality = rig.quality.emplace();
    quality.rms_px = wire.quality().rms_px();
    quality.board_poses = wire.quality().board_poses();
    check.finite(quality.rms_px, "rig quality");
    read_all(wire.quality().cameras(), quality.cameras, check);
  }
  if (check.problem().empty()) check.result(validate(rig), "rig");
}

}  // namespace flamefield
