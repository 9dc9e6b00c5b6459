#include "reconstruct/phantom/phantom.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "reconstruct/metrics.h"

namespace flamefield {
namespace {

constexpr PhantomKind kFlames[] = {PhantomKind::Bunsen, PhantomKind::Swirl, PhantomKind::Stratified};

TEST(Phantom, NamesGoBothWays) {
  for (int k = 0; k < 6; ++k) {
    const auto kind = static_cast<PhantomKind>(k);
    EXPECT_EQ(phantom_kind_from_name(name_of(kind)), kind);
  }
  EXPECT_EQ(phantom_kind_from_name("candle"), std::nullopt);
}

double integral(const Volume& v) {
  return std::accumulate(v.values.begin(), v.values.end(), 0.0) * v.grid.spacing_mm.prod();
}

TEST(Phantom, TheBodiesHaveTheirAnalyticVolumes) {
  const Grid grid = centred_grid(40, 40, 40, 1);
  const auto volume_of = [&](PhantomKind kind) { return integral(make_phantom({.kind = kind}, grid)); };
  EXPECT_NEAR(volume_of(PhantomKind::Torus), 2 * M_PI * M_PI * 10.8 * 4.4 * 4.4, 20);
  EXPECT_NEAR(volume_of(PhantomKind::HollowSphere), 4.0 / 3 * M_PI * (std::pow(14, 3) - std::pow(8.8, 3)),
              60);
  EXPECT_NEAR(volume_of(PhantomKind::Gaussian), std::pow(2 * M_PI * 5.2 * 5.2, 1.5), 10);
}

TEST(Phantom, AFlameIsThinHollowPartlyDarkAndWithinUnitRange) {
  for (PhantomKind kind : kFlames) {
    const Volume v = make_phantom({.kind = kind}, centred_grid(52, 55, 52, 1.32));
    const auto [low, high] = std::ranges::minmax(v.values);
    EXPECT_GE(low, 0);
    EXPECT_LE(high, 1);
    EXPECT_GT(high, 0.5);
    const double lit =
        static_cast<double>(std::ranges::count_if(v.values, [](float f) { return f > 0.25f; }));
    EXPECT_LT(lit / static_cast<double>(v.values.size()), 0.25);
    EXPECT_GT(lit / static_cast<double>(v.values.size()), 0.01);
  }
}

TEST(Phantom, IsTheSameFlameOnAnyResolution) {
  for (PhantomKind kind : kFlames) {
    const Volume coarse = make_phantom({.kind = kind, .seed = 3}, centred_grid(26, 26, 26, 3));
    const Volume fine = make_phantom({.kind = kind, .seed = 3}, centred_grid(78, 78, 78, 1));
    const auto m = compare(coarse, resample(fine, coarse.grid));
    ASSERT_TRUE(m.has_value());
    EXPECT_GT(m->pearson, 0.995);
  }
}

TEST(Phantom, EvolvesContinuouslyAndForgetsItself) {
  const Grid grid = centred_grid(30, 30, 30, 2);
  const auto at = [&](double time_s) {
    return make_phantom({.kind = PhantomKind::Stratified, .seed = 2, .time_s = time_s}, grid);
  };
  const Volume start = at(0);
  const double near = compare(start, at(0.001))->pearson, far = compare(start, at(3))->pearson;
  EXPECT_GT(near, 0.999);
  EXPECT_LT(far, 0.9);
}

TEST(Phantom, SeedsMakeDifferentFlames) {
  const Grid grid = centred_grid(30, 30, 30, 2);
  const Volume a = make_phantom({.kind = PhantomKind::Swirl, .seed = 1}, grid);
  EXPECT_EQ(a.values, make_phantom({.kind = PhantomKind::Swirl, .seed = 1}, grid).values);
  EXPECT_LT(compare(a, make_phantom({.kind = PhantomKind::Swirl, .seed = 2}, grid))->pearson, 0.9);
}

}  // namespace
}  // namespace flamefield
