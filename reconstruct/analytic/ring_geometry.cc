#include "reconstruct/analytic/ring_geometry.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace flamefield {

namespace {

using Eigen::Vector3d;

constexpr double kLengthTolerance = 0.005;  // of the radius
constexpr double kAngleTolerance = 0.005;   // rad
constexpr double kStepTolerance = 0.02;     // of the spacing

const char* const kAdvice = "use another solver, e.g. hessian or sirt: they take any geometry";

tl::unexpected<Error> refuse(const Camera& camera, std::string_view fault, std::string_view why) {
  return invalid_input(concat("fdk: camera ", camera.name, " ", fault), why, kAdvice);
}

// Least-squares circle through the camera centres seen from above (Kasa, IEEE Trans. Instrum. Meas. 25,
// 1976), 2 c . p + (R^2 - |c|^2) = |p|^2, at the height of most.
void fit_circle(const std::vector<Camera>& cameras, RingGeometry& ring) {
  const auto n = static_cast<Eigen::Index>(cameras.size());
  Eigen::MatrixX3d a(n, 3);
  Eigen::VectorXd b(n);
  std::vector<double> heights_mm;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Vector3d p = cameras[static_cast<std::size_t>(i)].centre_mm();
    a.row(i) << 2 * p.x(), 2 * p.z(), 1;
    b[i] = p.x() * p.x() + p.z() * p.z();
    heights_mm.push_back(p.y());
  }
  const auto middle = heights_mm.begin() + n / 2;
  std::ranges::nth_element(heights_mm, middle);
  const Vector3d c = a.colPivHouseholderQr().solve(b);
  ring.centre_mm = {c[0], *middle, c[1]};
  ring.radius_mm = std::sqrt(std::max(0.0, c[2] + c[0] * c[0] + c[1] * c[1]));
}

// The camera farthest off the circle is to blame, not the first that it has pulled the circle away from.
Result<> check_radii(const std::vector<Camera>& cameras, const RingGeometry& ring) {
  const auto radius = [&](const Camera& camera) {
    const Vector3d offset = camera.centre_mm() - ring.centre_mm;
    return std::hypot(offset.x(), offset.z());
  };
  const auto miss = [&](const Camera& camera) { return std::abs(radius(camera) - ring.radius_mm); };
  const Camera& worst = *std::ranges::max_element(cameras, {}, miss);
  if (miss(worst) <= kLengthTolerance * ring.radius_mm) return {};
  return refuse(worst, concat("stands ", radius(worst), " mm from the axis"),
                concat("the ring's radius is ", ring.radius_mm, " mm"));
}

Result<> check_camera(const Camera& camera, const RingGeometry& ring) {
  const Eigen::Matrix3d world_from_camera = camera.camera_from_world.inverse().rotation;
  const Vector3d right = world_from_camera.col(0), sight = world_from_camera.col(2),
                 offset = camera.centre_mm() - ring.centre_mm;
  const double tolerance_mm = kLengthTolerance * ring.radius_mm;
  if (camera.is_distorted()) return refuse(camera, "has a distorting lens", "the filter needs straight rows");
  if (std::abs(right.y()) > kAngleTolerance || std::abs(sight.y()) > kAngleTolerance)
    return refuse(camera, "is not level", "filtering runs along image rows, in the plane of the ring");
  if (std::abs(offset.y()) > tolerance_mm)
    return refuse(camera, concat("stands ", offset.y(), " mm off the others' height"),
                  "the ring must be flat");
  const Vector3d to_axis = -offset;
  const double miss_mm = to_axis.x() * sight.z() - to_axis.z() * sight.x();
  if (std::abs(miss_mm) > tolerance_mm || to_axis.dot(sight) < 0)
    return refuse(camera, concat("looks past the ring's axis by ", miss_mm, " mm"), "it must look at it");
  return {};
}

}  // namespace

Result<RingGeometry> ring_geometry(const std::vector<Camera>& cameras) {
  constexpr double kPi = std::numbers::pi;
  if (cameras.size() < 3) {
    return invalid_input(concat("fdk: ", cameras.size(), " cameras"), "a ring has at least three", kAdvice);
  }
  RingGeometry ring;
  fit_circle(cameras, ring);
  if (auto ok = check_radii(cameras, ring); !ok) return tl::unexpected(ok.error());
  for (const Camera& camera : cameras)
    if (auto ok = check_camera(camera, ring); !ok) return tl::unexpected(ok.error());

  const auto angle = [&](const Camera& camera) {
    const Vector3d p = camera.centre_mm() - ring.centre_mm;
    return std::atan2(p.z(), p.x());
  };
  const auto step = [&](std::size_t i) {
    return std::remainder(angle(cameras[i]) - angle(cameras[i - 1]), 2 * kPi);
  };
  for (std::size_t i = 1; i < cameras.size(); ++i) ring.step_rad += step(i);
  ring.step_rad /= static_cast<double>(cameras.size() - 1);
  for (std::size_t i = 1; i < cameras.size(); ++i) {
    if (std::abs(step(i) - ring.step_rad) > kStepTolerance * std::abs(ring.step_rad))
      return refuse(cameras[i], concat("stands ", step(i) * 180 / kPi, " deg after its neighbour"),
                    concat("the mean step is ", ring.step_rad * 180 / kPi, " deg, and all must be even"));
  }
  ring.coverage_rad = std::abs(ring.step_rad) * static_cast<double>(cameras.size());
  const double slack = 1.001 * std::abs(ring.step_rad);
  if (ring.coverage_rad < kPi - slack || ring.coverage_rad > 2 * kPi + 0.5 * slack) {
    return invalid_input(concat("fdk: the cameras cover ", ring.coverage_rad * 180 / kPi, " deg"),
                         "it takes 180 to 360 deg", kAdvice);
  }
  return ring;
}

}  // namespace flamefield
