#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "services/store/file.h"
#include "services/store/rig_export.h"
#include "services/store/rig_file.h"
#include "tests/support/scratch.h"

namespace flamefield {
namespace {

// Two cameras in general position, one of them with a lens.
Rig two_cameras() {
  Rig rig;
  for (int i = 0; i < 2; ++i) {
    Camera c;
    c.name = i == 0 ? "left" : "right";
    c.image_width_px = 640 + i;
    c.image_height_px = 480;
    c.fx_px = 812.123456789012345;
    c.fy_px = 811.9 + 1.0 / 3;
    c.cx_px = 319.5;
    c.cy_px = 239.25;
    if (i == 1) c.distortion = {-0.28, 0.07, 1e-4, -2e-5, 0.011};
    const double a = 0.3 + i;
    c.camera_from_world.rotation << std::cos(a), 0, std::sin(a), 0, 1, 0, -std::sin(a), 0, std::cos(a);
    c.camera_from_world.translation_mm = {1.0 / 7, -20.5, 300};
    rig.cameras.push_back(c);
  }
  rig.quality =
      RigQuality{0.0421, 21, {{20, 1080, 2, 0.04, 0.11, 0.05, 1e-4}, {21, 1134, 0, 0.05, 0.1, 0.06, 2e-4}}};
  return rig;
}

std::string message_for(const std::filesystem::path& path, const std::string& text) {
  overwrite(path, text);
  const auto rig = read_rig(path);
  return rig ? "read" : rig.error().message;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(RigFile, KeepsEveryDigit) {
  const Scratch scratch;
  ASSERT_TRUE(write_rig(scratch / "rig.yaml", two_cameras()));
  const auto rig = read_rig(scratch / "rig.yaml");
  ASSERT_TRUE(rig) << rig.error().message;
  EXPECT_EQ(fingerprint(*rig), fingerprint(two_cameras()));
  ASSERT_TRUE(rig->quality);
  EXPECT_EQ(rig->quality->rms_px, 0.0421);
  EXPECT_EQ(rig->quality->board_poses, 21);
  ASSERT_EQ(rig->quality->cameras.size(), 2u);
  EXPECT_EQ(rig->quality->cameras[1].corners, 1134);
  EXPECT_EQ(rig->quality->cameras[0].rotation_sigma_rad, 1e-4);
}

// The example of the manual, written by hand: no lens, no quality.
TEST(RigFile, ReadsTheLeastThatAFileMayHold) {
  const Scratch scratch;
  overwrite(scratch / "rig.yaml",
            "%YAML:1.0\n---\nformat: flamefield-rig-1\ncameras:\n   - name: cam00\n     image_width: 52\n"
            "     image_height: 55\n     camera_matrix: !!opencv-matrix\n        rows: 3\n        cols: 3\n"
            "        dt: d\n        data: [ 240., 0., 25.5, 0., 240., 27., 0., 0., 1. ]\n"
            "     camera_from_world: !!opencv-matrix\n        rows: 3\n        cols: 4\n        dt: d\n"
            "        data: [ 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 300. ]\n");
  const auto rig = read_rig(scratch / "rig.yaml");
  ASSERT_TRUE(rig) << rig.error().message;
  ASSERT_EQ(rig->cameras.size(), 1u);
  EXPECT_EQ(rig->cameras[0].fx_px, 240);
  EXPECT_EQ(rig->cameras[0].cy_px, 27);
  EXPECT_FALSE(rig->cameras[0].is_distorted());
  EXPECT_EQ(rig->cameras[0].camera_from_world.translation_mm, Eigen::Vector3d(0, 0, 300));
}

TEST(RigFile, NamesFileCameraAndFieldOfAFault) {
  const Scratch scratch;
  const auto path = scratch / "rig.yaml";
  ASSERT_TRUE(write_rig(path, two_cameras()));
  const std::string good = *read_text_file(path);
  const auto expect_names = [&](const std::string& text, const std::vector<std::string>& names) {
    const std::string message = message_for(path, text);
    for (const std::string& name : names)
      EXPECT_NE(message.find(name), std::string::npos) << name << ": " << message;
  };
  expect_names(replaced(good, "image_width: 641", "image_wdth: 641"), {"rig.yaml", "right", "image_width"});
  expect_names(replaced(good, "camera_matrix", "camera_matrx"), {"rig.yaml", "left", "camera_matrix"});
  expect_names(replaced(good, "name: right", "name: left"), {"rig.yaml", "left", "twice"});
  expect_names(replaced(good, "name: right", "nome: right"), {"rig.yaml", "camera 1"});
  expect_names(replaced(good, "flamefield-rig-1", "flamefield-rig-9"), {"rig.yaml", "format"});
  expect_names(replaced(good, "rows: 3", "rows: 300000000"), {"rig.yaml", "left"});
  expect_names(replaced(good, "image_width: 641", "image_width: -641"), {"rig.yaml", "right"});
  expect_names("hello\n", {"rig.yaml"});
  expect_names("", {"rig.yaml"});
}

TEST(RigFile, CutShortAnywhereIsAnErrorThatNamesTheFile) {
  const Scratch scratch;
  ASSERT_TRUE(write_rig(scratch / "whole.yaml", two_cameras()));
  std::string bytes = *read_text_file(scratch / "whole.yaml");
  while (bytes.back() == '\n') bytes.pop_back();
  for (std::size_t length = 0; length < bytes.size(); length += 7) {
    const std::string message = message_for(scratch / "cut.yaml", bytes.substr(0, length));
    EXPECT_NE(message.find("cut.yaml"), std::string::npos) << "at " << length << ": " << message;
  }
}

TEST(RigFile, DamageNeverCrashesTheReader) {
  const Scratch scratch;
  ASSERT_TRUE(write_rig(scratch / "rig.yaml", two_cameras()));
  const std::string bytes = *read_text_file(scratch / "rig.yaml");
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  for (int trial = 0; trial < 500; ++trial) {
    std::string damaged = bytes;
    damaged[random() % damaged.size()] ^= static_cast<char>(1u << random() % 8);
    overwrite(scratch / "rig.yaml", damaged);
    const auto rig = read_rig(scratch / "rig.yaml");
    EXPECT_TRUE(!rig || validate(*rig));
  }
}

TEST(RigFile, WritesNothingForARigThatIsInvalid) {
  const Scratch scratch;
  Rig rig = two_cameras();
  rig.cameras[0].name = rig.cameras[1].name;
  EXPECT_FALSE(write_rig(scratch / "rig.yaml", rig));
  EXPECT_TRUE(scratch.is_empty());
}

// COLMAP puts (0, 0) at the outer corner of the top-left pixel, we put it at that pixel's centre.
TEST(RigExport, MovesThePrincipalPointToColmapsPixelCorners) {
  const Scratch scratch;
  ASSERT_TRUE(export_colmap(scratch / "colmap", two_cameras()));
  std::ifstream cameras(scratch / "colmap/cameras.txt");
  std::string comment, model;
  std::getline(cameras, comment);
  int id = 0, width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  cameras >> id >> model >> width >> height >> fx >> fy >> cx >> cy;
  EXPECT_EQ(model, "OPENCV");
  EXPECT_EQ(cx, 320);
  EXPECT_EQ(cy, 239.75);
  EXPECT_NE(read_text_file(scratch / "colmap/cameras.txt")->find("2 FULL_OPENCV 641"), std::string::npos);
  EXPECT_NE(read_text_file(scratch / "colmap/images.txt")->find("right"), std::string::npos);
}

TEST(RigExport, WritesOneMrcalModelACameraInMetres) {
  const Scratch scratch;
  ASSERT_TRUE(export_mrcal(scratch / "ring.cameramodel", two_cameras()));
  const std::string text = *read_text_file(scratch / "ring-right.cameramodel");
  EXPECT_NE(text.find("'lensmodel': 'LENSMODEL_OPENCV5'"), std::string::npos);
  EXPECT_NE(text.find(", -0.020500000000000001, 0.2999999"), std::string::npos) << text;
}

TEST(RigExport, TellsThatKalibrHasNoK3) {
  const Scratch scratch;
  const auto exported = export_kalibr(scratch / "camchain.yaml", two_cameras());
  ASSERT_FALSE(exported);
  EXPECT_NE(exported.error().message.find("right"), std::string::npos);
  Rig rig = two_cameras();
  rig.cameras[1].distortion[4] = 0;
  ASSERT_TRUE(export_kalibr(scratch / "camchain.yaml", rig));
  EXPECT_NE(read_text_file(scratch / "camchain.yaml")->find("T_cn_cnm1"), std::string::npos);
}

TEST(RigExport, AKalibrCameraChainComesBackButForTheWorld) {
  const Scratch scratch;
  Rig rig = two_cameras();
  for (Camera& camera : rig.cameras) camera.distortion[4] = 0;
  ASSERT_TRUE(export_kalibr(scratch / "camchain.yaml", rig));
  const auto back = read_kalibr(scratch / "camchain.yaml");
  ASSERT_TRUE(back) << back.error().message;
  ASSERT_EQ(back->cameras.size(), 2u);
  const Rigid3 world_from_first = rig.cameras[0].camera_from_world.inverse();
  for (std::size_t i = 0; i < 2; ++i) {
    const Camera &ours = rig.cameras[i], &theirs = back->cameras[i];
    EXPECT_EQ(theirs.name, ours.name);
    EXPECT_EQ(theirs.image_width_px, ours.image_width_px);
    EXPECT_EQ(theirs.fx_px, ours.fx_px);
    EXPECT_EQ(theirs.cy_px, ours.cy_px);
    EXPECT_EQ(theirs.distortion, ours.distortion);
    const Rigid3 expected = ours.camera_from_world * world_from_first;
    EXPECT_LT((theirs.camera_from_world.rotation - expected.rotation).norm(), 1e-12);
    EXPECT_LT((theirs.camera_from_world.translation_mm - expected.translation_mm).norm(), 1e-9);
  }
}

TEST(RigExport, ReadsWhatKalibrItselfWrites) {
  const Scratch scratch;
  overwrite(
      scratch / "camchain.yaml",
      "cam0:\n  cam_overlaps: [1]\n  camera_model: pinhole\n  distortion_coeffs: [-0.2, 0.05, 1.0e-04, 0]\n"
      "  distortion_model: radtan\n  intrinsics: [461.6, 460.2, 362.6, 248.1]\n  resolution: [752, 480]\n"
      "  rostopic: /cam0/image_raw\n"
      "cam1:\n  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, -0.11]\n  - [0.0, 1.0, 0.0, 0.0]\n"
      "  - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n  cam_overlaps: [0]\n  camera_model: pinhole\n"
      "  distortion_coeffs: [-0.2, 0.05, 0.0, 0.0]\n  distortion_model: radtan\n"
      "  intrinsics: [460.0, 459.0, 370.0, 250.0]\n  resolution: [752, 480]\n  rostopic: /right/image_raw\n");
  const auto rig = read_kalibr(scratch / "camchain.yaml");
  ASSERT_TRUE(rig) << rig.error().message;
  EXPECT_EQ(rig->cameras[1].name, "right");
  EXPECT_NEAR(rig->cameras[1].camera_from_world.translation_mm.x(), -110, 1e-9);
  EXPECT_EQ(rig->cameras[0].distortion[2], 1e-4);
  const auto fault = [&](const std::string& text) {
    overwrite(scratch / "camchain.yaml", text);
    const auto read = read_kalibr(scratch / "camchain.yaml");
    return read ? "read" : read.error().message;
  };
  EXPECT_NE(fault("cam0:\n  camera_model: omni\n").find("cam0.camera_model"), std::string::npos);
  EXPECT_NE(fault("other: 1\n").find("cam0"), std::string::npos);
  EXPECT_NE(fault("{").find("camchain.yaml"), std::string::npos);
}

}  // namespace
}  // namespace flamefield
