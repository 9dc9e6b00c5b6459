#include "reconstruct/projector/column_kernels.h"

#include <gtest/gtest.h>

#include <hwy/targets.h>

#include <cmath>
#include <limits>

#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

// Runs the test on every instruction set that this machine has, then goes back to the best.
template <class Body>
void on_every_target(const Body& body) {
  const auto choose = [](std::int64_t targets) {
    hwy::SetSupportedTargetsForTest(targets);
    hwy::GetChosenTarget().DeInit();
  };
  std::int64_t left = hwy::SupportedTargets();
  for (; left != 0; left &= left - 1) {
    choose(left & -left);
    body(std::string(vector_target()));
  }
  choose(0);
}

// Patches of strips with everything that occurs: lines of sight inside, at and beyond the faces of the box,
// pixels of all sizes that the vector kernels take, images larger and smaller than the box, part of the
// columns out of bounds.
struct Scene {
  static constexpr std::size_t kPatches = 3;
  StripShape shape;
  int cols = 0, planes = 0, alike = 1;
  std::vector<float> q, half, m, half_px;
  std::vector<float> volume, images;

  explicit Scene(std::uint64_t seed) {
    Stream stream(seed, 0);
    shape.ny = 1 + static_cast<int>(stream.below(70));
    shape.rows = 1 + static_cast<int>(stream.below(90));
    shape.others = kFewestVectorColumns + static_cast<int>(stream.below(9));
    shape.begin =
        static_cast<int>(stream.below(static_cast<std::size_t>(shape.others - kFewestVectorColumns + 1)));
    shape.end = shape.begin + kFewestVectorColumns +
                static_cast<int>(stream.below(
                    static_cast<std::size_t>(shape.others - shape.begin - kFewestVectorColumns + 1)));
    shape.column = static_cast<std::size_t>((shape.ny + 15) / 16 * 16);
    shape.line = static_cast<std::size_t>((shape.rows + 15) / 16 * 16);
    shape.stride = shape.column;
    shape.axis_up = stream.uniform() * 2 * shape.rows - shape.rows / 2.0;
    shape.height = shape.ny / 2.0 + 10 * stream.uniform();
    const bool area = stream.uniform() < 0.7, narrow = stream.uniform() < 0.5;
    alike = stream.uniform() < 0.5 ? 2 : 1;
    planes = 1 + static_cast<int>(stream.below(kPatch));
    cols = kPatch / planes;
    for (int i = 0; i < static_cast<int>(kPatches) * kPatch; ++i) {
      const int plane = i % kPatch % planes;
      if (alike == 2 && plane % 2 == 1 && i % kPatch < cols * planes) {  // as the plane before
        m.push_back(m.back());
        half_px.push_back(half_px.back());
      } else {
        m.push_back(static_cast<float>(0.5 + 1.25 * stream.uniform()));
        half_px.push_back(area ? static_cast<float>(std::min(1.0 / m.back(), 0.2 + stream.uniform())) : 0.0f);
      }
      half.push_back(area ? static_cast<float>(0.1 + (narrow ? 0.4 : 0.9) * stream.uniform()) : 0.0f);
      q.push_back(static_cast<float>(stream.uniform() * (shape.others + 4) - 2.5));
    }
    volume =
        random_values(shape.column * static_cast<std::size_t>(shape.others) * kPatches * kPatch, seed + 1);
    for (std::size_t i = 0; i < volume.size(); ++i)
      if (i % shape.column >= static_cast<std::size_t>(shape.ny)) volume[i] = 0;
    images = random_values(shape.line * kPatches * kPatch, seed + 2);
    for (std::size_t i = 0; i < images.size(); ++i)
      if (i % shape.line >= static_cast<std::size_t>(shape.rows)) images[i] = 0;
  }
  // work(patch) for patches that lie one behind the other.
  template <class Work>
  void each_patch(const Work& work) const {
    for (std::size_t i = 0; i < kPatches; ++i) {
      const std::size_t at = i * kPatch, plane = shape.column * static_cast<std::size_t>(shape.others);
      work(StripPatch{cols, planes, &q[at], &half[at], &m[at], &half_px[at], alike, at * plane, plane,
                      at * shape.line, shape.line});
    }
  }
  // Largest difference where it counts; padding may hold anything.
  static double difference(const std::vector<float>& a, const std::vector<float>& b, std::size_t pitch,
                           int used) {
    double worst = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (i % pitch >= static_cast<std::size_t>(used)) continue;
      const double d = std::abs(static_cast<double>(a[i]) - b[i]);
      if (!(d <= worst)) worst = d;
    }
    return worst;
  }
};

// What an earlier, diverged field has left in the buffers must not matter.
void poison(const Scene& scene, KernelScratch& scratch) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> volume(scene.volume.size(), kNan), images(scene.images.size(), kNan);
  const std::vector<std::uint8_t> lit(volume.size() / scene.shape.column, 1);
  scene.each_patch([&](const StripPatch& patch) {
    add_forward(volume.data(), lit.data(), patch, scene.shape, scratch, images.data());
    add_adjoint(images.data(), patch, scene.shape, scratch, volume.data());
  });
}

TEST(ColumnKernels, VectorsGiveWhatThePlainLoopsGiveOnEveryInstructionSet) {
  on_every_target([](const std::string& target) {
    SCOPED_TRACE(target);
    for (std::uint64_t seed = 1; seed <= 150; ++seed) {
      SCOPED_TRACE(seed);
      const Scene scene(seed);
      KernelScratch scratch;
      scratch.fit(scene.shape);
      poison(scene, scratch);
      const std::vector<std::uint8_t> lit(scene.volume.size() / scene.shape.column, 1);
      std::vector<float> lines(scene.images.size(), 0), plain_lines(lines);
      std::vector<float> columns(scene.volume.size(), 0), plain_columns(columns);
      scene.each_patch([&](const StripPatch& patch) {
        add_forward(scene.volume.data(), lit.data(), patch, scene.shape, scratch, lines.data());
        add_forward_plain(scene.volume.data(), patch, scene.shape, plain_lines.data());
        add_adjoint(scene.images.data(), patch, scene.shape, scratch, columns.data());
        add_adjoint_plain(scene.images.data(), patch, scene.shape, plain_columns.data());
      });
      ASSERT_LT(Scene::difference(lines, plain_lines, scene.shape.line, scene.shape.rows), 3e-5);
      ASSERT_LT(Scene::difference(columns, plain_columns, scene.shape.column, scene.shape.ny), 3e-5);
    }
  });
}

TEST(Footprint, IsTheAverageOfTheInterpolatedFieldOverTheBox) {
  // A field on 5 voxels, flat beyond the outermost centres, zero beyond the faces; averaged by fine sums.
  const std::vector<float> field = {2, -1, 4, 0.5, 3};
  const auto value = [&](double x) {
    if (x < -0.5 || x > 4.5) return 0.0;
    const double inside = std::clamp(x, 0.0, 4.0);
    const auto low = std::min<std::size_t>(3, static_cast<std::size_t>(inside));
    return field[low] + (inside - static_cast<double>(low)) * (field[low + 1] - field[low]);
  };
  for (double h : {0.2, 0.5, 0.9, 1.4, 2.0})
    for (double x = 1.0; x <= 3.0; x += 0.13) {
      double sum = 0;
      constexpr int kSteps = 4000;
      for (int i = 0; i < kSteps; ++i) sum += value(x - h + 2 * h * (i + 0.5) / kSteps) / kSteps;
      const Footprint f = footprint(x, h, 5);
      double average = 0;
      for (int i = 0; i < f.count; ++i)
        average += static_cast<double>(f.weight[i]) * field[static_cast<std::size_t>(f.first + i)];
      if (x - h >= -0.5 && x + h <= 4.5) {
        EXPECT_NEAR(average, sum, 1e-4) << "x " << x << " h " << h;
      }
    }
}

TEST(Footprint, SeesAConstantFieldAsFarAsTheBoxReaches) {
  for (double h : {0.0, 0.3, 1.0, 1.7})
    for (double x = -4; x <= 9; x += 0.37) {
      const Footprint f = footprint(x, h, 6);
      double sum = 0;
      for (int i = 0; i < f.count; ++i) sum += static_cast<double>(f.weight[i]);
      const double low = std::max(x - h, -0.5), high = std::min(x + h, 5.5);
      EXPECT_NEAR(sum, h > 0 ? std::max(0.0, high - low) / (2 * h) : x >= -0.5 && x <= 5.5, 1e-6);
    }
}

}  // namespace
}  // namespace flamefield
