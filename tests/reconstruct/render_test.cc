#include "reconstruct/render.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "reconstruct/phantom/phantom.h"
#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

// Length of a ray inside a box, by slabs.
double chord(const Ray& ray, const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  double enter = -INFINITY, leave = INFINITY;
  for (int a = 0; a < 3; ++a) {
    const double t0 = (low[a] - ray.origin_mm[a]) / ray.direction[a],
                 t1 = (high[a] - ray.origin_mm[a]) / ray.direction[a];
    enter = std::max(enter, std::min(t0, t1));
    leave = std::min(leave, std::max(t0, t1));
  }
  return std::max(0.0, leave - enter);
}

TEST(Render, AUniformBoxGivesTheChordLengthOfEveryRay) {
  const Grid grid = centred_grid(20, 24, 17, 1.5);
  const Volume volume(grid, 2);
  for (const Camera& camera : crooked_ring(grid, 4).cameras) {
    const Image image = render_view(volume, camera, {});
    for (int y = 0; y < image.height_px; ++y)
      for (int x = 0; x < image.width_px; ++x) {
        EXPECT_NEAR(image.at(x, y),
                    2 * chord(pixel_ray(camera, Eigen::Vector2d(x, y)), grid.lower_mm(), grid.upper_mm()),
                    2e-4);
      }
  }
}

TEST(Render, AGaussianGivesItsAnalyticLineIntegral) {
  const Grid grid = centred_grid(48, 48, 48, 1);
  const double sigma = 0.13 * 48;
  const Volume volume = make_phantom({.kind = PhantomKind::Gaussian}, grid);
  for (const Camera& camera : level_ring(grid, 3).cameras) {
    const Image image = render_view(volume, camera, {});
    for (int y = 4; y < 44; y += 3)
      for (int x = 4; x < 44; x += 3) {
        const Ray ray = pixel_ray(camera, Eigen::Vector2d(x, y));
        const double miss = ray.direction.cross(ray.origin_mm).norm();
        const double expected = std::exp(-miss * miss / (2 * sigma * sigma)) * sigma * std::sqrt(2 * M_PI);
        EXPECT_NEAR(image.at(x, y), expected, 0.01 * sigma * std::sqrt(2 * M_PI));
      }
  }
}

// The plain sum of Eq. 1 over the reference interpolation, without any skipping.
float plain_integral(const Volume& volume, const Ray& ray, double step_mm) {
  double sum = 0;
  for (double t = 0; t < 2000; t += step_mm)
    sum += sample(volume, ray.origin_mm + t * ray.direction) * step_mm;
  return static_cast<float>(sum);
}

TEST(Render, SkippingEmptySpaceLosesNothing) {
  const Grid grid = centred_grid(37, 29, 33, 1);
  Volume volume(grid);
  Stream stream(7, 0);
  for (int i = 0; i < 40; ++i) volume.values[stream.below(volume.values.size())] = 1;
  volume.at(0, 0, 0) = volume.at(36, 28, 32) = volume.at(8, 8, 8) = volume.at(7, 16, 15) = 1;
  for (const Camera& camera : crooked_ring(grid, 3).cameras) {
    const Image image = render_view(volume, camera, {.step_voxels = 0.05});
    for (int y = 0; y < image.height_px; y += 2)
      for (int x = 0; x < image.width_px; x += 2) {
        EXPECT_NEAR(image.at(x, y), plain_integral(volume, pixel_ray(camera, Eigen::Vector2d(x, y)), 0.02),
                    0.02);
      }
  }
}

TEST(Render, TheImageDoesNotDependOnTheNumberOfThreads) {
  const Grid grid = centred_grid(30, 30, 30, 1);
  const Volume volume = make_phantom({.kind = PhantomKind::Stratified, .seed = 5}, grid);
  const Camera camera = crooked_ring(grid, 1).cameras[0];
  EXPECT_EQ(render_view(volume, camera, {.threads = 1}).pixels,
            render_view(volume, camera, {.threads = 3}).pixels);
}

TEST(Render, CamerasOfDifferentSizesAreRefused) {
  const Grid grid = centred_grid(10, 10, 10, 1);
  Rig rig = level_ring(grid, 2);
  rig.cameras[1].image_width_px = 11;
  const auto images = render(Volume(grid), rig, {});
  ASSERT_FALSE(images.has_value());
  EXPECT_NE(images.error().message.find("cam01"), std::string::npos);
}

Projections flat_images(float value, int side = 200) {
  Projections p{{"a"}, side, side, {}};
  p.values.assign(p.pixels_per_view(), value);
  return p;
}

TEST(Noise, ShotNoiseHasTheVarianceOfItsPhotonCount) {
  for (const double photons : {5.0, 300.0, 5000.0}) {
    Projections p = flat_images(2);
    ASSERT_TRUE(add_noise(p, {.photons = photons, .read_noise = 3}).has_value());
    double mean = 0, square = 0;
    for (float v : p.values) {
      mean += v * photons / 2;
      square += v * photons / 2 * v * photons / 2;
    }
    const double n = static_cast<double>(p.values.size());
    mean /= n;
    const double variance = square / n - mean * mean;
    EXPECT_NEAR(mean, photons, 5 * std::sqrt((photons + 9) / n));
    EXPECT_NEAR(variance, photons + 9, 0.04 * (photons + 9));
  }
}

TEST(Noise, QuantisationLeavesTheLevelsOfItsBitDepth) {
  Projections p = flat_images(0);
  for (std::size_t i = 0; i < p.values.size(); ++i) p.values[i] = static_cast<float>(i) / 100;
  const float brightest = p.values.back();
  const Projections before = p;
  ASSERT_TRUE(add_noise(p, {.bits = 4}).has_value());
  for (std::size_t i = 0; i < p.values.size(); ++i) {
    const float level = p.values[i] / brightest * 15;
    EXPECT_NEAR(level, std::round(level), 1e-3);
    EXPECT_LE(std::abs(p.values[i] - before.values[i]), brightest / 30 * 1.001f);
  }
}

TEST(Noise, TheSeedDecides) {
  Projections a = flat_images(1), b = a, c = a;
  ASSERT_TRUE(add_noise(a, {.photons = 50, .seed = 4}).has_value());
  ASSERT_TRUE(add_noise(b, {.photons = 50, .seed = 4}).has_value());
  ASSERT_TRUE(add_noise(c, {.photons = 50, .seed = 5}).has_value());
  EXPECT_EQ(a.values, b.values);
  EXPECT_NE(a.values, c.values);
}

TEST(Noise, ReadNoiseWithoutPhotonsIsRefused) {
  Projections p = flat_images(1);
  EXPECT_FALSE(add_noise(p, {.read_noise = 2}).has_value());
}

}  // namespace
}  // namespace flamefield
