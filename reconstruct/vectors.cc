#include "reconstruct/vectors.h"

#include "proto/check.h"

namespace flamefield {

namespace {
constexpr std::size_t kGrain = 8192;
}

double dot(Team& team, std::span<const float> a, std::span<const float> b) {
  expect(a.size() == b.size(), "vectors have one size");
  std::vector<double> sums((a.size() + kGrain - 1) / kGrain, 0);
  team.run_ranges(a.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    double sum = 0;
    for (std::size_t i = begin; i < end; ++i) sum += static_cast<double>(a[i]) * b[i];
    sums[begin / kGrain] = sum;
  });
  double total = 0;
  for (double sum : sums) total += sum;
  return total;
}

double dot(const Projector& projector, Team& team, std::span<const float> a, std::span<const float> b) {
  return projector.share().sum(projector.layout(), [&](std::size_t begin, std::size_t end) {
    return dot(team, a.subspan(begin, end - begin), b.subspan(begin, end - begin));
  });
}

std::vector<float> even_volume(const Layout& l) {
  const auto voxels =
      static_cast<std::size_t>(l.nx) * static_cast<std::size_t>(l.ny) * static_cast<std::size_t>(l.nz);
  return l.pack_volume(std::vector<float>(voxels, 1));
}

std::vector<float> even_images(const Layout& l) {
  const auto pixels =
      static_cast<std::size_t>(l.views) * static_cast<std::size_t>(l.rows) * static_cast<std::size_t>(l.cols);
  return l.pack_images(std::vector<float>(pixels, 1));
}

void add_scaled(Team& team, double factor, std::span<const float> x, std::span<float> y) {
  expect(x.size() == y.size(), "vectors have one size");
  const auto f = static_cast<float>(factor);
  team.run_ranges(x.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) y[i] += f * x[i];
  });
}

}  // namespace flamefield
