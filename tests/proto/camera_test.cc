#include "proto/camera.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

namespace flamefield {
namespace {

Camera some_camera() {
  Camera camera;
  camera.name = "cam00";
  camera.image_width_px = 659;
  camera.image_height_px = 494;
  camera.fx_px = 1212;
  camera.fy_px = 1215;
  camera.cx_px = 330;
  camera.cy_px = 245;
  camera.distortion = {-0.1, 0.05, 1e-3, -2e-3, 0.01};
  camera.camera_from_world = {
      Eigen::AngleAxisd(0.3, Eigen::Vector3d(0.2, 1, -0.1).normalized()).toRotationMatrix(),
      Eigen::Vector3d(5, -10, 600)};
  return camera;
}

TEST(Camera, RayOfAPixelProjectsBackOntoThePixel) {
  const Camera camera = some_camera();
  for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(0, 0), {658, 493}, {330.25, 100.75}}) {
    const Ray ray = pixel_ray(camera, pixel);
    const auto back = project(camera, ray.origin_mm + 550 * ray.direction);
    ASSERT_TRUE(back);
    EXPECT_LT((*back - pixel).norm(), 1e-7) << pixel.transpose();
  }
}

TEST(Camera, PointBehindTheCameraHasNoPixel) {
  const Camera camera = some_camera();
  const Ray ray = pixel_ray(camera, {300, 200});
  EXPECT_FALSE(project(camera, ray.origin_mm - 10 * ray.direction));
}

TEST(Camera, BinningKeepsTheDirectionOfAMergedPixelsCentre) {
  const Camera camera = some_camera();
  const Camera small = cropped_and_binned(camera, 100, 60, 300, 300, 3);
  EXPECT_EQ(small.image_width_px, 100);
  // The centre of merged pixel (10, 20) is the centre of original pixel (100 + 31, 60 + 61).
  const Ray merged = pixel_ray(small, {10, 20}), original = pixel_ray(camera, {131, 121});
  EXPECT_LT((merged.direction - original.direction).norm(), 1e-12);
}

TEST(Camera, ValidationNamesTheCameraAndTheRemedy) {
  Camera camera = some_camera();
  camera.camera_from_world.rotation(0, 0) += 0.1;
  const auto result = validate(camera);
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().message.find("cam00"), std::string::npos);
  EXPECT_NE(result.error().message.find("orthonormal"), std::string::npos);
}

}  // namespace
}  // namespace flamefield
