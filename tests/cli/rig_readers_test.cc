// Rigs as other programs read them. Skipped, with the reason, where Debian's package is not installed.
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "acquire/simulator/true_rig.h"
#include "services/store/rig_export.h"
#include "services/store/rig_file.h"
#include "tests/cli/program.h"

namespace flamefield {
namespace {

Rig some_rig() {
  Rig rig = ring_with_tolerances({.cameras = 3, .seed = 4});
  for (Camera& camera : rig.cameras) {
    camera.distortion[2] = 1e-3;
    camera.distortion[3] = -2e-3;
  }
  rig.cameras[1].fy_px *= 1.01;
  return rig;
}

std::vector<Eigen::Vector3d> points_of_a_box() {
  std::vector<Eigen::Vector3d> points;
  for (double x : {-40.0, 40.0})
    for (double y : {0.0, 80.0})
      for (double z : {-40.0, 40.0}) points.emplace_back(x, y, z);
  return points;
}

bool has(const std::string& command) {
  return shell("/tmp", command + " > /dev/null 2>&1").exit_code == 0;
}

// Points as a Python list.
std::string points_text() {
  std::ostringstream out;
  for (const auto& p : points_of_a_box()) out << '[' << p.x() << ',' << p.y() << ',' << p.z() << "],";
  return concat("[", out.str(), "]");
}

// "x y" lines, camera by camera, against our own projection.
void expect_pixels(const Rig& rig, const std::string& lines, double limit_px) {
  std::istringstream in(lines);
  for (const Camera& camera : rig.cameras) {
    for (const Eigen::Vector3d& point : points_of_a_box()) {
      Eigen::Vector2d pixel(0, 0);
      ASSERT_TRUE(in >> pixel.x() >> pixel.y()) << lines;
      EXPECT_LT((pixel - *project(camera, point)).norm(), limit_px) << camera.name;
    }
  }
}

TEST(RigReaders, OpenCvProjectsAsWeDoFromRigYaml) {
  if (!has("/usr/bin/python3 -c 'import cv2'")) GTEST_SKIP() << "python3-opencv is not installed";
  const Scratch scratch;
  const Rig rig = some_rig();
  ASSERT_TRUE(write_rig(scratch / "rig.yaml", rig));
  overwrite(scratch / "read.py", R"(
import cv2, numpy as np
points = np.array()" + points_text() +
                                     R"(, float)
file = cv2.FileStorage('rig.yaml', cv2.FILE_STORAGE_READ)
cameras = file.getNode('cameras')
for i in range(cameras.size()):
    c = cameras.at(i)
    m = c.getNode('camera_from_world').mat()
    pixels, _ = cv2.projectPoints(points, cv2.Rodrigues(m[:, :3])[0], m[:, 3], c.getNode('camera_matrix').mat(),
                                  c.getNode('distortion_coefficients').mat())
    for x, y in pixels.reshape(-1, 2): print(repr(float(x)), repr(float(y)))
)");
  const ProgramResult result = shell(scratch.path(), "/usr/bin/python3 read.py");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  expect_pixels(rig, result.out, 1e-6);
}

TEST(RigReaders, MrcalProjectsAsWeDoFromItsCameraModels) {
  if (!has("/usr/bin/python3 -c 'import mrcal'")) GTEST_SKIP() << "python3-mrcal is not installed";
  const Scratch scratch;
  const Rig rig = some_rig();
  ASSERT_TRUE(export_mrcal(scratch / "ring.cameramodel", rig));
  overwrite(scratch / "read.py", R"(
import mrcal, numpy as np
points = 1e-3 * np.array()" + points_text() +
                                     R"(, float)
for i in range(3):
    m = mrcal.cameramodel('ring-cam%02d.cameramodel' % i)
    pixels = mrcal.project(mrcal.transform_point_Rt(m.extrinsics_Rt_fromref(), points), *m.intrinsics())
    for x, y in pixels: print(repr(float(x)), repr(float(y)))
)");
  const ProgramResult result = shell(scratch.path(), "/usr/bin/python3 read.py");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  expect_pixels(rig, result.out, 1e-6);
}

// Kalibr itself is not packaged by Debian; its camera chain is YAML, read here by PyYAML and projected as its
// pinhole-radtan model says. The first camera's frame stands for the world.
TEST(RigReaders, KalibrsCameraChainProjectsAsWeDoInThePointOfViewOfItsFirstCamera) {
  if (!has("/usr/bin/python3 -c 'import yaml, numpy'"))
    GTEST_SKIP() << "python3-yaml or numpy is not installed";
  const Scratch scratch;
  Rig rig = some_rig();
  ASSERT_TRUE(export_kalibr(scratch / "camchain.yaml", rig));
  overwrite(scratch / "read.py", R"(
import yaml, numpy as np
points = 1e-3 * np.array()" + points_text() +
                                     R"(, float)
chain = yaml.safe_load(open('camchain.yaml'))
motion = np.eye(4)
for i in range(3):
    c = chain['cam%d' % i]
    if i > 0: motion = np.array(c['T_cn_cnm1'], float) @ motion
    fx, fy, cx, cy = c['intrinsics']
    k1, k2, p1, p2 = c['distortion_coeffs']
    p = points @ motion[:3, :3].T + motion[:3, 3] + motion[:3, :3] @ np.array([0, 0, 0.6])
    x, y = p[:, 0] / p[:, 2], p[:, 1] / p[:, 2]
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2 * r2
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    for a, b in zip(fx * u + cx, fy * v + cy): print(repr(float(a)), repr(float(b)))
)");
  const ProgramResult result = shell(scratch.path(), "/usr/bin/python3 read.py");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Rigid3 world_from_first = rig.cameras[0].camera_from_world.inverse();
  const Rigid3 ahead{Eigen::Matrix3d::Identity(), {0, 0, 600}};
  for (Camera& camera : rig.cameras)
    camera.camera_from_world = camera.camera_from_world * world_from_first * ahead;
  expect_pixels(rig, result.out, 1e-6);
}

// Through COLMAP's reader and its binary writer and back: the numbers of the text survive.
TEST(RigReaders, ColmapReadsOurTextModelAndWritesTheSame) {
  if (!has("colmap help")) GTEST_SKIP() << "colmap is not installed";
  const Scratch scratch;
  const Rig rig = some_rig();
  ASSERT_TRUE(export_colmap(scratch / "ours", rig));
  const ProgramResult result =
      shell(scratch.path(),
            "mkdir binary theirs && export QT_QPA_PLATFORM=offscreen && "
            "colmap model_converter --input_path ours --output_path binary --output_type BIN && "
            "colmap model_converter --input_path binary --output_path theirs --output_type TXT");
  ASSERT_EQ(result.exit_code, 0) << result.out << result.err;
  const auto numbers = [&](const std::string& file) {
    std::vector<double> out;
    std::istringstream lines(*read_text_file(scratch / file));
    std::vector<std::string> kept;
    for (std::string line; std::getline(lines, line);)
      if (!line.empty() && line[0] != '#') kept.push_back(line);
    std::sort(kept.begin(), kept.end());  // COLMAP does not keep the order
    for (const std::string& line : kept) {
      std::istringstream words(line);
      for (std::string word; words >> word;) {
        char* end = nullptr;
        const double value = std::strtod(word.c_str(), &end);
        if (*end == '\0') out.push_back(value);
      }
    }
    return out;
  };
  for (const char* file : {"cameras.txt", "images.txt"}) {
    const auto ours = numbers(concat("ours/", file)), theirs = numbers(concat("theirs/", file));
    ASSERT_EQ(ours.size(), theirs.size()) << file;
    ASSERT_GT(ours.size(), 20u) << file;
    for (std::size_t i = 0; i < ours.size(); ++i)
      EXPECT_NEAR(ours[i], theirs[i], 1e-9 * (1 + std::abs(ours[i]))) << file << ' ' << i;
  }
}

}  // namespace
}  // namespace flamefield
