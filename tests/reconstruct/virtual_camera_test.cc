#include "reconstruct/virtual_camera.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "reconstruct/area_map.h"
#include "reconstruct/metrics.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/prepare.h"
#include "reconstruct/render.h"
#include "reconstruct/solver.h"
#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

const Grid kGrid = centred_grid(24, 26, 24, 1);

// Sensors with about four pixels a voxel, tilted, rolled, aside of the aim and with bent lenses.
Rig tilted_sensors(int views) {
  Rig rig = *make_ring({.views = views,
                        .spacing_rad = std::numbers::pi / views,
                        .radius_mm = 150,
                        .elevation_rad = 0.15,
                        .image_width_px = 180,
                        .image_height_px = 180},
                       centred_grid(40, 40, 40, 1));
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    Camera& c = rig.cameras[i];
    const double sign = i % 2 ? -1 : 1;
    const Eigen::Matrix3d turn = (Eigen::AngleAxisd(0.05 * sign, Eigen::Vector3d::UnitZ()) *
                                  Eigen::AngleAxisd(0.015 * sign, Eigen::Vector3d::UnitY()))
                                     .toRotationMatrix();
    c.camera_from_world = Rigid3{turn, Eigen::Vector3d::Zero()} * c.camera_from_world;
    c.distortion = {-0.4, 0.5, 0.002, -0.003, 0};
    c.cx_px += 2 * sign;
    c.fy_px *= 1.02;
  }
  return rig;
}

CameraImages sensor_images(const Volume& truth, const Rig& rig) {
  CameraImages out;
  for (const Camera& c : rig.cameras)
    out[c.name] = render_view(truth, c, {.step_voxels = 0.25, .pixel_samples = 2});
  return out;
}

double relative_difference(std::span<const float> a, std::span<const float> b) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference += std::pow(a[i] - b[i], 2);
    size += std::pow(b[i], 2);
  }
  return std::sqrt(difference / size);
}

TEST(VirtualCamera, IsLevelUndistortedAndOfTheSameCentre) {
  const Rig rig = tilted_sensors(4);
  const auto made = virtual_cameras(rig.cameras, kGrid, 0, 4);
  ASSERT_TRUE(made.has_value()) << made.error().message;
  EXPECT_TRUE(made->not_level.empty());
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const Camera& c = made->cameras[i];
    EXPECT_TRUE(validate(c).has_value());
    EXPECT_LT((c.centre_mm() - rig.cameras[i].centre_mm()).norm(), 1e-9);
    const Eigen::Matrix3d& r = c.camera_from_world.rotation;
    EXPECT_LT((r.row(1).transpose() + Eigen::Vector3d::UnitY()).norm(), 1e-12);
    EXPECT_NEAR(r(0, 1), 0, 1e-12);
    EXPECT_NEAR(r(2, 1), 0, 1e-12);
    EXPECT_FALSE(c.is_distorted());
    EXPECT_EQ(c.fx_px, c.fy_px);
    // Two points a voxel apart, across the line of sight at the domain's centre, are a pixel apart.
    const Eigen::Vector3d right = r.row(0);
    EXPECT_NEAR((*project(c, right) - *project(c, Eigen::Vector3d::Zero())).norm(), 1, 1e-9);
    EXPECT_NEAR((*project(c, Eigen::Vector3d::UnitY()) - *project(c, Eigen::Vector3d::Zero())).norm(), 1,
                1e-9);
  }
}

TEST(VirtualCamera, SeesWhatADirectRenderingThroughItSees) {
  const Rig rig = tilted_sensors(4);
  const Volume truth = make_phantom({.kind = PhantomKind::Stratified, .seed = 3}, kGrid);
  const auto out = prepare({sensor_images(truth, rig)}, {}, rig, kGrid, {});
  ASSERT_TRUE(out.has_value()) << out.error().message;
  const auto direct = render(truth, out->rig, {.step_voxels = 0.25, .pixel_samples = 5});
  ASSERT_TRUE(direct.has_value());
  ASSERT_EQ(direct->cols, out->projections.cols);
  for (std::size_t v = 0; v < 4; ++v)
    EXPECT_LT(relative_difference(out->projections.view(v), direct->view(v)), 0.008) << "view " << v;
}

TEST(VirtualCamera, CoversTheProjectedDomain) {
  const Rig rig = tilted_sensors(5);
  const auto out = prepare({sensor_images(Volume(kGrid, 1), rig)}, {}, rig, kGrid, {});
  ASSERT_TRUE(out.has_value());
  for (std::size_t v = 0; v < 5; ++v) {
    const Camera& c = out->rig.cameras[v];
    for (int corner = 0; corner < 8; ++corner) {
      const auto pixel =
          project(c, {corner & 1 ? 12.0 : -12.0, corner & 2 ? 13.0 : -13.0, corner & 4 ? 12.0 : -12.0});
      EXPECT_GT(pixel->minCoeff(), -0.5);
      EXPECT_LT(pixel->x(), c.image_width_px - 0.5);
      EXPECT_LT(pixel->y(), c.image_height_px - 0.5);
    }
    // A lit box ends before the image does.
    EXPECT_EQ(out->projections.view(v)[0], 0);
    const int middle = out->projections.rows / 2 * c.image_width_px + c.image_width_px / 2;
    EXPECT_GT(out->projections.view(v)[static_cast<std::size_t>(middle)], 20);
  }
}

TEST(VirtualCamera, ReconstructsAsWellAsTheTiltedOne) {
  const Rig rig = tilted_sensors(9);
  const Volume truth = make_phantom({.kind = PhantomKind::Stratified, .seed = 4}, kGrid);
  const CameraImages images = sensor_images(truth, rig);
  Recipe recipe;
  recipe.solver = "mlem";
  recipe.settings["mlem.max_iterations"] = std::int64_t{40};
  double pearson[2] = {};
  for (bool level : {false, true}) {
    const auto out = prepare({images}, {}, rig, kGrid, {.level = level});
    ASSERT_TRUE(out.has_value()) << out.error().message;
    const auto result = reconstruct(out->projections, out->rig, kGrid, recipe, {});
    ASSERT_TRUE(result.has_value()) << result.error().message;
    pearson[level] = compare(truth, result->volume)->pearson;
  }
  EXPECT_GT(pearson[1], 0.94);
  EXPECT_GT(pearson[1], pearson[0] - 0.003);
}

TEST(VirtualCamera, ASteepCameraIsOnlyUndistortedAndSaysSo) {
  Rig rig = *make_ring(
      {.views = 2, .radius_mm = 150, .elevation_rad = 0.9, .image_width_px = 200, .image_height_px = 200},
      centred_grid(60, 60, 60, 1));
  rig.cameras[0] = tilted_sensors(1).cameras[0];
  rig.cameras[0].name = "flat";
  const Volume truth = make_phantom({.kind = PhantomKind::Gaussian}, kGrid);
  const auto out = prepare({sensor_images(truth, rig)}, {}, rig, kGrid, {});
  ASSERT_TRUE(out.has_value()) << out.error().message;
  std::string all;
  for (const std::string& line : out->provenance) all += line + "\n";
  EXPECT_NE(all.find("cam01 looks too steeply"), std::string::npos) << all;
  EXPECT_EQ(all.find("camera flat looks"), std::string::npos) << all;
  const auto direct = render(truth, out->rig, {.step_voxels = 0.25, .pixel_samples = 5});
  for (std::size_t v = 0; v < 2; ++v)
    EXPECT_LT(relative_difference(out->projections.view(v), direct->view(v)), 0.01);
}

TEST(VirtualCamera, WhatLeavesTheSensorIsCutOffAllViews) {
  Rig rig = tilted_sensors(3);
  rig.cameras[1] =
      cropped_and_binned(rig.cameras[1], 0, 0, 180, 100, 1);  // a sensor that sees the upper half
  const Volume truth = make_phantom({.kind = PhantomKind::Gaussian}, kGrid);
  const auto out = prepare({sensor_images(truth, rig)}, {}, rig, kGrid, {});
  ASSERT_TRUE(out.has_value()) << out.error().message;
  std::string all;
  for (const std::string& line : out->provenance) all += line + "\n";
  EXPECT_NE(all.find("leaves the sensors of cam01\n"), std::string::npos) << all;
  const auto direct = render(truth, out->rig, {.step_voxels = 0.25, .pixel_samples = 5});
  for (std::size_t v = 0; v < 3; ++v)
    EXPECT_LT(relative_difference(out->projections.view(v), direct->view(v)), 0.01);
}

TEST(VirtualCamera, ACameraThatDoesNotSeeTheDomainIsNamed) {
  Rig rig = tilted_sensors(3);
  const CameraImages images = sensor_images(Volume(kGrid, 1), rig);
  const auto message = [&](const Rig& with) {
    const auto out = prepare({images}, {}, with, kGrid, {});
    return out ? std::string("accepted") : out.error().message;
  };
  Rig aside = rig;
  aside.cameras[1].cx_px += 4000;
  EXPECT_NE(message(aside).find("cam01 does not see the domain"), std::string::npos) << message(aside);
  Rig behind = rig;
  behind.cameras[2].camera_from_world =
      Rigid3{Eigen::Vector3d(-1, 1, -1).asDiagonal().toDenseMatrix(), Eigen::Vector3d::Zero()} *
      behind.cameras[2].camera_from_world;
  EXPECT_NE(message(behind).find("camera cam02"), std::string::npos) << message(behind);
  Rig inside = rig;
  inside.cameras[0].camera_from_world.translation_mm.setZero();
  EXPECT_NE(message(inside).find("camera cam00"), std::string::npos) << message(inside);
}

// Each pixel as the mean of many samples of the sensor image, taken where the view's sub-pixels fall.
TEST(AreaMap, IsTheMeanOfTheSensorPixelsUnderAPixel) {
  const Rig rig = tilted_sensors(2);
  const Camera& sensor = rig.cameras[1];
  const Camera view = virtual_cameras({sensor}, kGrid, 0, 4)->cameras[0];
  const AreaMap map = area_map(sensor, view, 2);
  Image image(180, 180);
  image.pixels = random_values(image.pixels.size(), 5);
  std::vector<float> window;
  for (int y = 0; y < map.window.height; ++y)
    for (int x = 0; x < map.window.width; ++x)
      window.push_back(image.at(map.window.x0 + x, map.window.y0 + y));
  const Image out = map.apply(window);
  constexpr int kSamples = 60;
  double worst = 0;
  for (int row = 0; row < map.rows; row += 7)
    for (int col = 0; col < map.cols; col += 5) {
      double sum = 0;
      for (int s = 0; s < kSamples * kSamples; ++s) {
        const Eigen::Vector2d at(col - 0.5 + (s % kSamples + 0.5) / kSamples,
                                 row - 0.5 + (s / kSamples + 0.5) / kSamples);
        const Eigen::Vector2d p =
            *project(sensor, pixel_ray(view, at).origin_mm + 100 * pixel_ray(view, at).direction);
        sum += image.at(static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y())));
      }
      worst = std::max(worst, std::abs(out.at(col, row) - sum / (kSamples * kSamples)));
    }
  EXPECT_LT(worst, 2e-3);
}

TEST(AreaMap, ConservesLight) {
  const Rig rig = tilted_sensors(1);
  const Camera view = virtual_cameras(rig.cameras, kGrid, 0, 4)->cameras[0];
  const AreaMap map = area_map(rig.cameras[0], view, 2);
  for (std::size_t pixel = 0; pixel + 1 < map.begin.size(); ++pixel) {
    double sum = 0;
    for (std::uint32_t i = map.begin[pixel]; i < map.begin[pixel + 1]; ++i) sum += map.weight[i];
    EXPECT_NEAR(sum, 1, 1e-5);
  }
}

}  // namespace
}  // namespace flamefield
