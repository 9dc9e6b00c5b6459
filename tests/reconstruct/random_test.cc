#include "reconstruct/random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace flamefield {
namespace {

// Known answers of the reference implementation (Random123, kat_vectors).
TEST(Philox, GivesThePublishedNumbers) {
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}),
            (std::array<std::uint32_t, 4>{0x6627e8d5u, 0xe169c58du, 0xbc57ac4cu, 0x9b00dbd8u}));
  constexpr std::uint32_t kOnes = 0xffffffffu;
  EXPECT_EQ(philox({kOnes, kOnes, kOnes, kOnes}, {kOnes, kOnes}),
            (std::array<std::uint32_t, 4>{0x408f276du, 0x41c83b0eu, 0xa20bc7c6u, 0x6d5451fdu}));
}

TEST(Stream, NormalNumbersHaveTheirMoments) {
  Stream stream(1, 2);
  double sum = 0, square = 0, fourth = 0;
  const int n = 200000;
  for (int i = 0; i < n; ++i) {
    const double v = stream.normal();
    sum += v, square += v * v, fourth += v * v * v * v;
  }
  EXPECT_NEAR(sum / n, 0, 0.012);
  EXPECT_NEAR(square / n, 1, 0.02);
  EXPECT_NEAR(fourth / n, 3, 0.15);
}

// Mean by numerical integration of the cut-off density.
double mean_of_truncated(double mu, double sigma) {
  double weight = 0, sum = 0;
  for (double x = 0.0005; x < 1; x += 0.001) {
    const double w = std::exp(-0.5 * (x - mu) * (x - mu) / (sigma * sigma));
    weight += w, sum += w * x;
  }
  return sum / weight;
}

TEST(Stream, TruncatedNormalNumbersFollowTheCutOffDensity) {
  for (const double mu : {0.0, 0.3, 1.0})
    for (const double sigma : {0.05, 0.5, 3.0}) {
      Stream stream(4, 7);
      double sum = 0;
      const int n = 40000;
      for (int i = 0; i < n; ++i) {
        const double v = stream.truncated_normal(mu, sigma);
        ASSERT_TRUE(v >= 0 && v <= 1);
        sum += v;
      }
      EXPECT_NEAR(sum / n, mean_of_truncated(mu, sigma), 0.01) << mu << " " << sigma;
    }
}

TEST(Stream, StreamsOfOneSeedDiffer) {
  Stream a(1, 1), b(1, 2), c(2, 1);
  EXPECT_NE(a.bits(), b.bits());
  EXPECT_NE(b.bits(), c.bits());
}

}  // namespace
}  // namespace flamefield
