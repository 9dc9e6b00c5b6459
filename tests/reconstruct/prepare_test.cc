#include "reconstruct/prepare.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <span>

#include "reconstruct/phantom/phantom.h"
#include "reconstruct/render.h"
#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

constexpr double kCounts = 8.0;

// A ring of sensors that see far more than the domain, each with its own dark level, hot pixels and vignette.
struct Bench {
  Grid grid = centred_grid(20, 22, 20, 2);
  Rig rig;
  CameraImages flame, dark, background, flat;

  Bench() {
    rig = *make_ring(
        {.views = 3, .spacing_rad = 0.5, .radius_mm = 400, .image_width_px = 220, .image_height_px = 160},
        centred_grid(50, 36, 50, 2));
    const Volume truth = make_phantom({.kind = PhantomKind::Gaussian}, grid);
    for (Camera& c : rig.cameras) {
      c.distortion = {-0.1, 0.02, 0.001, -0.001, 0};
      const Image ideal = render_view(truth, c, {.step_voxels = 0.25, .pixel_samples = 2});
      Image& d = dark[c.name] = Image(220, 160, 10);
      Image& b = background[c.name] = Image(220, 160);
      Image& f = flame[c.name] = Image(220, 160);
      Image& w = flat[c.name] = Image(220, 160);
      for (int y = 0; y < 160; ++y)
        for (int x = 0; x < 220; ++x) {
          if (x % 37 == 5 && y % 29 == 3) d.at(x, y) = 90;
          const double vignette =
              1 - 0.3 * (std::pow((x - 110) / 110.0, 2) + std::pow((y - 80) / 80.0, 2)) / 2;
          b.at(x, y) = d.at(x, y) + static_cast<float>(3 * vignette);
          w.at(x, y) = d.at(x, y) + static_cast<float>(150 * vignette);
          const double level = b.at(x, y) + kCounts * vignette * ideal.at(x, y);
          f.at(x, y) = static_cast<float>(std::round(level));  // 8-bit sensor
        }
    }
  }

  References references() const { return {{dark}, {background}, {flat}}; }
  Result<Prepared> prepared(const PrepareOptions& options) const {
    return prepare({flame}, references(), rig, grid, options);
  }
};

// |a - gain b| / |gain b| with the best gain. A flat field is relative to its mean over the used window, so
// one factor per view is free.
struct Agreement {
  double gain = 0, error = 0;
};
Agreement agreement(std::span<const float> a, std::span<const float> b) {
  double ab = 0, bb = 0, error = 0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    ab += a[i] * b[i];
    bb += std::pow(b[i], 2);
  }
  const double gain = ab / bb;
  for (std::size_t i = 0; i < b.size(); ++i) error += std::pow(a[i] - gain * b[i], 2);
  return {gain, std::sqrt(error / bb) / gain};
}

TEST(Prepare, RecoversTheProjectionsBehindSensorImages) {
  const Bench bench;
  for (bool level : {true, false}) {
    const auto out = bench.prepared({.level = level, .counts_per_unit = kCounts});
    ASSERT_TRUE(out.has_value()) << out.error().message;
    const auto expected = render(make_phantom({.kind = PhantomKind::Gaussian}, bench.grid), out->rig,
                                 {.step_voxels = 0.25, .pixel_samples = 4});
    ASSERT_TRUE(expected.has_value());
    ASSERT_EQ(expected->values.size(), out->projections.values.size());
    EXPECT_EQ(out->projections.view_names, expected->view_names);
    for (std::size_t v = 0; v < 3; ++v) {
      const Agreement found = agreement(out->projections.view(v), expected->view(v));
      EXPECT_NEAR(found.gain, 0.95, 0.06);
      EXPECT_LT(found.error, 0.02) << "level " << level;
    }
  }
}

TEST(Prepare, APixelIsAboutAVoxelWideAndTheDomainIsInside) {
  const Bench bench;
  for (bool level : {true, false}) {
    const auto out = prepare({bench.flame}, {}, bench.rig, bench.grid, {.level = level});
    ASSERT_TRUE(out.has_value());
    for (const Camera& c : out->rig.cameras) {
      const double width = c.fx_px * 2 / 400;
      EXPECT_GT(width, 0.6);
      EXPECT_LT(width, 1.6);
      for (int corner = 0; corner < 8; ++corner) {
        const Eigen::Vector3d at(corner & 1 ? 20 : -20, corner & 2 ? 22 : -22, corner & 4 ? 20 : -20);
        const auto pixel = project(c, at);
        EXPECT_GT(pixel->x(), -0.5);
        EXPECT_GT(pixel->y(), -0.5);
        EXPECT_LT(pixel->x(), c.image_width_px - 0.5);
        EXPECT_LT(pixel->y(), c.image_height_px - 0.5);
      }
    }
  }
}

TEST(Prepare, AveragingKeepsTheLevel) {
  const Bench bench;
  CameraImages uniform;
  for (const Camera& c : bench.rig.cameras) uniform[c.name] = Image(220, 160, 42);
  for (bool level : {true, false}) {
    const auto out =
        prepare({uniform}, {}, bench.rig, bench.grid, {.level = level, .binning = 3, .counts_per_unit = 2});
    ASSERT_TRUE(out.has_value());
    for (float v : out->projections.values) EXPECT_NEAR(v, 21, 1e-4);
  }
}

TEST(Prepare, EveryStepIsInTheProvenance) {
  const Bench bench;
  for (bool level : {true, false}) {
    const auto out = bench.prepared({.level = level, .equal_views = true});
    ASSERT_TRUE(out.has_value());
    std::string all;
    for (const std::string& line : out->provenance) all += line + "\n";
    for (const char* word :
         {"saturated", "background", "flat", "hot pixels", level ? "level cameras" : "cut to",
          level ? "sensor pixels wide" : "merged", "grey levels", "negative", "total"}) {
      EXPECT_NE(all.find(word), std::string::npos) << word << " in " << all;
    }
  }
}

TEST(Prepare, CamerasWithoutImagesAreLeftOut) {
  Bench bench;
  bench.flame.erase("cam01");
  const auto out = prepare({bench.flame}, {.dark = {bench.dark}}, bench.rig, bench.grid, {});
  ASSERT_TRUE(out.has_value());
  EXPECT_EQ(out->projections.view_names, (std::vector<std::string>{"cam00", "cam02"}));
}

TEST(Prepare, WrongImagesAreRefusedByName) {
  const auto message = [](const Bench& b) {
    const auto out = prepare({b.flame}, {.dark = {b.dark}}, b.rig, b.grid, {});
    return out ? std::string("accepted") : out.error().message;
  };
  Bench stranger;
  stranger.flame["cam99"] = Image(220, 160);
  EXPECT_NE(message(stranger).find("cam99 is not in the rig"), std::string::npos);
  Bench small;
  small.flame["cam01"] = Image(100, 160);
  EXPECT_NE(message(small).find("cam01 has 100x160"), std::string::npos);
  Bench bad;
  bad.flame["cam02"].at(3, 4) = std::numeric_limits<float>::infinity();
  EXPECT_NE(message(bad).find("row 4, column 3"), std::string::npos);
  Bench lacking;
  lacking.dark.erase("cam00");
  EXPECT_NE(message(lacking).find("no dark image of camera cam00"), std::string::npos);
}

TEST(Prepare, SaturatedPixelsAreCountedWhereTheyAreUsed) {
  const Bench bench;
  MeanImages flame{bench.flame};
  flame.saturated["cam01"] = {0, 80 * 220 + 110, 80 * 220 + 111};  // a far corner and the middle
  const auto out = prepare(flame, {}, bench.rig, bench.grid, {});
  ASSERT_TRUE(out.has_value());
  EXPECT_EQ(out->saturated, (std::vector<std::size_t>{0, 2, 0}));
  EXPECT_NE(out->provenance[0].find("cam01 2"), std::string::npos) << out->provenance[0];
}

TEST(Prepare, HotPixelsAreRepairedAndDoNotCountAsSaturated) {
  Bench bench;
  const auto sound = bench.prepared({.counts_per_unit = kCounts});
  MeanImages flame{bench.flame};
  for (auto& [camera, image] : flame.images)
    for (int y = 3; y < 160; y += 29)
      for (int x = 5; x < 220; x += 37) {
        image.at(x, y) = 255;  // they flicker: subtraction alone does not remove them
        flame.saturated[camera].push_back(static_cast<std::uint32_t>(y * 220 + x));
      }
  const auto out = prepare(flame, bench.references(), bench.rig, bench.grid, {.counts_per_unit = kCounts});
  ASSERT_TRUE(sound && out);
  EXPECT_EQ(out->saturated, (std::vector<std::size_t>{0, 0, 0}));
  for (std::size_t v = 0; v < 3; ++v)
    EXPECT_LT(agreement(out->projections.view(v), sound->projections.view(v)).error, 0.01);
}

TEST(Prepare, ADomainOfOneLayerAndADarkFlameAreNoSpecialCases) {
  Bench bench;
  for (auto& [camera, image] : bench.flame) image = bench.background.at(camera);
  for (const Grid& grid : {centred_grid(20, 1, 20, 2), centred_grid(1, 22, 1, 2)}) {
    const auto out = prepare({bench.flame}, bench.references(), bench.rig, grid, {});
    ASSERT_TRUE(out.has_value()) << out.error().message;
    EXPECT_GT(out->projections.rows, 0);
    for (float v : out->projections.values) EXPECT_EQ(v, 0);
  }
}

TEST(Prepare, EqualViewsUndoTheGainsOfCameras) {
  Bench bench;
  const auto before = prepare({bench.flame}, {}, bench.rig, bench.grid, {.equal_views = true});
  for (float& p : bench.flame["cam01"].pixels) p *= 3;
  const auto after = prepare({bench.flame}, {}, bench.rig, bench.grid, {.equal_views = true});
  ASSERT_TRUE(before && after);
  const Agreement tripled = agreement(after->projections.view(1), before->projections.view(1));
  const Agreement other = agreement(after->projections.view(0), before->projections.view(0));
  EXPECT_LT(tripled.error, 1e-5);
  EXPECT_NEAR(tripled.gain, other.gain, 1e-4);
}

}  // namespace
}  // namespace flamefield
