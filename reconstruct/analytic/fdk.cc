#include "reconstruct/analytic/fdk.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "reconstruct/analytic/ring_geometry.h"

namespace flamefield {

std::vector<SettingField> fdk_fields(FdkOptions& o) {
  static constexpr std::array<std::string_view, 3> kNames = {"ramp", "shepp-logan", "hann"};
  return {{"window", "", 0, 0, "of the ramp filter; hann is the softest", choice_of(o.window, kNames)}};
}

namespace {

constexpr double kPi = std::numbers::pi;

// The ramp filter at distances of n samples of width a (Kak and Slaney, Eq. 61; Shepp and Logan, IEEE Trans.
// Nucl. Sci. 21, 1974). Hann's window 1/2 + 1/2 cos(pi f / f_Nyquist) mixes neighbours in space.
double ramp(int n, double a) {
  if (n == 0) return 1 / (4 * a * a);
  return n % 2 == 0 ? 0 : -1 / (kPi * kPi * a * a * n * n);
}
double kernel(RampWindow window, int n, double a) {
  if (window == RampWindow::SheppLogan) return -2 / (kPi * kPi * a * a * (4.0 * n * n - 1));
  if (window == RampWindow::Ramp) return ramp(n, a);
  return 0.5 * ramp(n, a) + 0.25 * (ramp(n - 1, a) + ramp(n + 1, a));
}

// What share of its line of sight a pixel column stands for, as lines are seen from both ends. angle: of the
// camera, from the beginning of the scan; fan: of the ray, in the turning sense.
double redundancy(const RingGeometry& ring, double angle_rad, double fan_rad, double largest_fan_rad) {
  const double over = (ring.coverage_rad - kPi) / 2;  // delta
  if (ring.coverage_rad > 2 * kPi - 0.5 * std::abs(ring.step_rad)) return 0.5;
  if (over <= largest_fan_rad) return 1;  // half a turn: as if rays were parallel
  const auto rise = [](double part) { return std::pow(std::sin(kPi / 2 * std::clamp(part, 0.0, 1.0)), 2); };
  // Parker's weights; the ray (angle + pi + 2 fan, -fan) is the same line.
  if (angle_rad < 2 * (over - fan_rad)) return rise(angle_rad / (2 * (over - fan_rad)));
  if (angle_rad > kPi - 2 * fan_rad) return rise((ring.coverage_rad - angle_rad) / (2 * (over + fan_rad)));
  return 1;
}

// Images weighted and filtered along their rows, in place of `images` (packed).
class Filter {
 public:
  Filter(const Problem& problem, const RingGeometry& ring, RampWindow window)
      : problem_(problem), ring_(ring), window_(window) {}

  void view(std::size_t v, std::span<float> out) const {
    const Layout& l = problem_.projector.layout();
    const Camera& camera = problem_.projector.cameras()[v];
    const double sample_mm = ring_.radius_mm / camera.fx_px;  // a pixel seen at the axis
    std::vector<float> weighted(l.pixels_per_view(), 0), taps(static_cast<std::size_t>(l.cols));
    for (int n = 0; n < l.cols; ++n)
      taps[static_cast<std::size_t>(n)] = static_cast<float>(sample_mm * kernel(window_, n, sample_mm));
    for (int col = 0; col < l.cols; ++col) weigh(v, col, weighted);
    for (int to = 0; to < l.cols; ++to)
      for (int from = 0; from < l.cols; ++from) {
        const float tap = taps[static_cast<std::size_t>(std::abs(to - from))];
        if (tap == 0) continue;
        const float* in = weighted.data() + static_cast<std::size_t>(from) * l.line;
        float* sum = out.data() + l.pixel(static_cast<int>(v), l.rows - 1, to);
        for (std::size_t i = 0; i < l.line; ++i) sum[i] += tap * in[i];
      }
  }

 private:
  // Cosine between ray and line of sight, and the share of the line.
  void weigh(std::size_t v, int col, std::span<float> weighted) const {
    const Layout& l = problem_.projector.layout();
    const Camera& camera = problem_.projector.cameras()[v];
    const Eigen::Matrix3d world_from_camera = camera.camera_from_world.inverse().rotation;
    const Eigen::Vector3d right = world_from_camera.col(0), sight = world_from_camera.col(2);
    const bool with_x = sight.x() * right.z() - sight.z() * right.x() > 0;  // azimuth grows to the right
    const double sense = (with_x ? 1 : -1) * (ring_.step_rad > 0 ? 1 : -1);
    const double x = (col - camera.cx_px) / camera.fx_px;
    const double edge =
        std::max(camera.cx_px + 0.5, camera.image_width_px - 0.5 - camera.cx_px) / camera.fx_px;
    const double angle = (static_cast<double>(v) + 0.5) * std::abs(ring_.step_rad);
    const double share = redundancy(ring_, angle, sense * std::atan(x), std::atan(edge));
    for (int row = 0; row < l.rows; ++row) {
      const double y = (row - camera.cy_px) / camera.fy_px;
      weighted[static_cast<std::size_t>(col) * l.line + static_cast<std::size_t>(l.rows - 1 - row)] =
          static_cast<float>(share / std::sqrt(1 + x * x + y * y)) *
          problem_.images[l.pixel(static_cast<int>(v), row, col)];
    }
  }
  const Problem& problem_;
  const RingGeometry& ring_;
  RampWindow window_;
};

// Adds what view v says about the column of voxels (x, z): its pixels lie on a vertical line of the image, at
// even distances.
void back_project(const Projector& projector, const RingGeometry& ring, std::size_t v,
                  std::span<const float> filtered, int x, int z, std::span<float> volume) {
  const Layout& l = projector.layout();
  const Camera& camera = projector.cameras()[v];
  const Grid& grid = projector.grid();
  const Eigen::Vector3d bottom = camera.camera_from_world * grid.voxel_centre_mm(x, 0, z);
  const double col = camera.cx_px + camera.fx_px * bottom.x() / bottom.z();
  if (!(bottom.z() > 0) || !(col >= 0) || !(col <= l.cols - 1)) return;
  const int left = std::min(static_cast<int>(col), std::max(l.cols - 2, 0));
  const auto right_share = static_cast<float>(col - left);
  const float* a = filtered.data() + l.pixel(static_cast<int>(v), l.rows - 1, left);
  const float* b = l.cols > 1 ? a + l.line : a;
  const double depth = ring.radius_mm / bottom.z();
  const auto weight = static_cast<float>(std::abs(ring.step_rad) * depth * depth);
  // From the bottom row upwards.
  const double first = l.rows - 1 - (camera.cy_px + camera.fy_px * bottom.y() / bottom.z());
  const double step = camera.fy_px * grid.spacing_mm.y() / bottom.z();
  float* out = volume.data() + l.voxel(x, 0, z);
  for (int y = 0; y < l.ny; ++y) {
    const double at = first + step * y;
    if (!(at >= 0) || !(at <= l.rows - 1)) continue;
    const int low = std::min(static_cast<int>(at), std::max(l.rows - 2, 0)),
              high = std::min(low + 1, l.rows - 1);
    const auto t = static_cast<float>(at - low);
    const float from_left = a[low] + t * (a[high] - a[low]), from_right = b[low] + t * (b[high] - b[low]);
    out[y] += weight * (from_left + right_share * (from_right - from_left));
  }
}

}  // namespace

Result<Solution> solve_fdk(const Problem& problem, const FdkOptions& options) {
  const Projector& projector = problem.projector;
  const auto ring = ring_geometry(projector.cameras());
  if (!ring) return tl::unexpected(ring.error());
  const Layout& layout = projector.layout();
  Monitor monitor(problem.control, 1, problem.stop);
  std::vector<float> filtered(layout.pixels(), 0);
  const Filter filter(problem, *ring, options.window);
  problem.team.run(projector.views(), [&](std::size_t v) { filter.view(v, filtered); });

  Solution out;
  out.volume.assign(layout.voxels(), 0);
  problem.team.run(static_cast<std::size_t>(layout.nz), [&](std::size_t z) {
    for (std::size_t v = 0; v < projector.views(); ++v)
      for (int x = 0; x < layout.nx; ++x)
        back_project(projector, *ring, v, filtered, x, static_cast<int>(z), out.volume);
  });
  constrain(problem, out.volume);
  projector.forward(problem.team, out.volume, filtered);
  const auto reason = monitor.after(1, relative_distance(filtered, problem.images));
  out.stop_reason = reason.value_or(StopReason::Iterations);
  out.iterations = 1;
  out.voxel_updates = static_cast<double>(layout.voxels()) * static_cast<double>(projector.views());
  out.history = monitor.history();
  return out;
}

}  // namespace flamefield
