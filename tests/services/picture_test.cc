#include "services/report/picture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>

#include "services/report/gnuplot.h"
#include "services/report/slices.h"
#include "services/report/volume_view.h"

namespace flamefield {
namespace {

// A value that names its voxel.
Volume numbered(int nx, int ny, int nz) {
  Volume volume(Grid{nx, ny, nz, {1, 2, 3}, {10, 20, 30}});
  for (int z = 0; z < nz; ++z) {
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) volume.at(x, y, z) = static_cast<float>(x + 10 * y + 100 * z);
    }
  }
  return volume;
}

Volume ball(const Eigen::Vector3d& centre_mm, double radius_mm) {
  Volume volume(centred_grid(24, 24, 24, 1));
  for (int z = 0; z < 24; ++z) {
    for (int y = 0; y < 24; ++y) {
      for (int x = 0; x < 24; ++x) {
        const double r = (volume.grid.voxel_centre_mm(x, y, z) - centre_mm).norm();
        volume.at(x, y, z) = r < radius_mm ? 1 : 0;
      }
    }
  }
  return volume;
}

// Centre of gravity of the opacity, px.
Eigen::Vector2d centroid(const RgbaImage& image) {
  Eigen::Vector2d sum(0, 0);
  double weight = 0;
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const double a = image.bytes[static_cast<std::size_t>(4 * (y * image.width_px + x) + 3)];
      sum += a * Eigen::Vector2d(x, y);
      weight += a;
    }
  }
  return sum / weight;
}

TEST(Slices, RowsRunDownAndBothAxesIncreaseToTheRightAndUp) {
  const Volume volume = numbered(3, 4, 5);
  const Slice z = slice(volume, Axis::Z, 2);
  EXPECT_EQ(z.image.width_px, 3);
  EXPECT_EQ(z.image.height_px, 4);
  EXPECT_EQ(z.image.at(1, 0), volume.at(1, 3, 2));
  EXPECT_EQ(z.image.at(1, 3), volume.at(1, 0, 2));
  EXPECT_DOUBLE_EQ(z.position_mm, 36);
  EXPECT_DOUBLE_EQ(z.right_mm[0], 9.5);
  EXPECT_DOUBLE_EQ(z.up_mm[1], 27);
  EXPECT_EQ(slice(volume, Axis::X, 1).image.at(4, 0), volume.at(1, 3, 4));
  EXPECT_EQ(slice(volume, Axis::Y, 3).image.at(2, 0), volume.at(2, 3, 4));
}

TEST(Slices, ReducingKeepsTheMeanAndTheBox) {
  const Volume volume = numbered(8, 4, 6);
  const Volume coarse = reduced(volume, 4);
  EXPECT_EQ(coarse.grid.nx, 4);
  EXPECT_EQ(coarse.grid.ny, 2);
  EXPECT_EQ(coarse.grid.nz, 3);
  EXPECT_TRUE(coarse.grid.lower_mm().isApprox(volume.grid.lower_mm()));
  EXPECT_TRUE(coarse.grid.upper_mm().isApprox(volume.grid.upper_mm()));
  double sum = 0, coarse_sum = 0;
  for (float v : volume.values) sum += static_cast<double>(v);
  for (float v : coarse.values) coarse_sum += 8 * static_cast<double>(v);
  EXPECT_NEAR(coarse_sum, sum, 1e-3 * sum);
}

TEST(Slices, MeanByHeightIsTheMeanOfEachLayer) {
  const std::vector<double> mean = mean_by_height(numbered(3, 2, 3));
  ASSERT_EQ(mean.size(), 2u);
  EXPECT_NEAR(mean[0], 101, 1e-9);
  EXPECT_NEAR(mean[1], 111, 1e-9);
}

TEST(ColourMaps, InfernoGetsBrighterAllTheWay) {
  double before = -1;
  for (const Rgb& c : inferno()) {
    const double luminance = 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
    EXPECT_GT(luminance, before - 0.75);
    before = luminance;
  }
}

TEST(ColourMaps, TheDivergingMapIsPaleInTheMiddleBlueBelowAndRedAbove) {
  const Rgb low = cool_warm()[0], middle = cool_warm()[127], high = cool_warm()[255];
  EXPECT_GT(low[2], low[0] + 80);
  EXPECT_GT(high[0], high[2] + 80);
  EXPECT_LT(std::abs(middle[0] - middle[2]), 12);
  EXPECT_GT(middle[1], 200);
}

TEST(ColourMaps, NaNIsGreyAndBeyondTheEndsAreTheEndColours) {
  EXPECT_EQ(colour_of(inferno(), std::nan(""), 0, 1), (Rgb{128, 128, 128}));
  EXPECT_EQ(colour_of(inferno(), -5, 0, 1), inferno()[0]);
  EXPECT_EQ(colour_of(inferno(), 5, 0, 1), inferno()[255]);
}

TEST(VolumeView, ABallStandsWhereTheCameraProjectsItsCentre) {
  VolumeViewOptions options{.width_px = 120, .height_px = 120};
  for (double azimuth_rad : {0.0, 0.8, 2.5, 4.0}) {
    options.azimuth_rad = azimuth_rad;
    const Eigen::Vector3d centre_mm(5, -3, 4);
    const Volume volume = ball(centre_mm, 3);
    const Camera camera = turntable_camera(volume.grid, options);
    const auto expected = project(camera, centre_mm);
    ASSERT_TRUE(expected);
    EXPECT_LT((centroid(ray_cast(volume, camera, options)) - *expected).norm(), 1.0) << azimuth_rad;
  }
}

TEST(VolumeView, TheBoxFitsIntoThePictureAtEveryTurntableAngle) {
  const Grid grid{30, 80, 50, {1, 1, 1}, {5, 0, -7}};
  VolumeViewOptions options{.width_px = 300, .height_px = 400};
  for (int i = 0; i < 12; ++i) {
    options.azimuth_rad = 0.5236 * i;
    const Camera camera = turntable_camera(grid, options);
    ASSERT_TRUE(validate(camera));
    for (unsigned corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d low = grid.lower_mm(), high = grid.upper_mm();
      const auto at = project(camera, {corner & 1 ? low.x() : high.x(), corner & 2 ? low.y() : high.y(),
                                       corner & 4 ? low.z() : high.z()});
      ASSERT_TRUE(at);
      EXPECT_TRUE(at->x() >= 0 && at->x() < 300 && at->y() >= 0 && at->y() < 400) << at->transpose();
    }
  }
}

TEST(VolumeView, EmptySpaceIsTransparent) {
  const VolumeViewOptions options{.width_px = 40, .height_px = 40};
  const Volume empty(centred_grid(8, 8, 8, 1));
  const RgbaImage image = ray_cast(empty, turntable_camera(empty.grid, options), options);
  for (std::size_t i = 3; i < image.bytes.size(); i += 4) ASSERT_EQ(image.bytes[i], 0);
}

TEST(VolumePicture, IsDrawnAtTheSizeAskedForAndShowsTheFlame) {
  const auto picture = volume_picture(ball({0, 0, 0}, 6), {.width_px = 800, .height_px = 450});
  ASSERT_TRUE(picture) << picture.error().message;
  EXPECT_EQ(picture->width_px, 800);
  EXPECT_EQ(picture->height_px, 450);
  int bright = 0;
  for (std::size_t i = 0; i < picture->bytes.size(); i += 3) bright += picture->bytes[i] > 200;
  EXPECT_GT(bright, 1000);
}

TEST(VolumePicture, RefusesNaNAndNamesTheVoxel) {
  Volume volume = ball({0, 0, 0}, 6);
  volume.values[77] = std::numeric_limits<float>::quiet_NaN();
  const auto picture = volume_picture(volume);
  ASSERT_FALSE(picture);
  EXPECT_EQ(picture.error().code, ErrorCode::InvalidInput);
  EXPECT_NE(picture.error().message.find("voxel 77"), std::string::npos);
}

TEST(Gnuplot, WhenItIsMissingThePackageIsNamed) {
  const char* path = std::getenv("PATH");
  const std::string saved = path ? path : "";
  setenv("PATH", "/nonexistent", 1);
  const ScratchFolder folder;
  const auto out = run_gnuplot("print 1", folder.path());
  setenv("PATH", saved.c_str(), 1);
  ASSERT_FALSE(out);
  EXPECT_EQ(out.error().code, ErrorCode::Unavailable);
  EXPECT_NE(out.error().message.find("gnuplot-nox"), std::string::npos);
}

TEST(Gnuplot, ItsOwnComplaintIsPassedOn) {
  const ScratchFolder folder;
  const auto out = run_gnuplot("plot nonsense(", folder.path());
  ASSERT_FALSE(out);
  EXPECT_NE(out.error().message.find("nonsense"), std::string::npos);
}

TEST(ScratchFolder, IsGoneAfterUse) {
  std::filesystem::path path;
  {
    const ScratchFolder folder;
    path = folder.path();
    EXPECT_TRUE(std::filesystem::is_directory(path));
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(Png, SurvivesEncodingAndDecoding) {
  RgbImage image(5, 3);
  for (std::size_t i = 0; i < image.bytes.size(); ++i) image.bytes[i] = static_cast<std::uint8_t>(17 * i);
  const auto back = rgb_from_png(png_from(image));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->bytes, image.bytes);
  EXPECT_FALSE(rgb_from_png("no png"));
  EXPECT_FALSE(rgb_from_png(""));
}

TEST(Png, AFailedWriteLeavesNothingBehind) {
  const ScratchFolder folder;
  EXPECT_FALSE(write_png(folder.path() / "missing" / "a.png", RgbImage(2, 2)));
  std::filesystem::create_directory(folder.path() / "taken");
  EXPECT_FALSE(write_png(folder.path() / "taken", RgbImage(2, 2)));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

}  // namespace
}  // namespace flamefield
