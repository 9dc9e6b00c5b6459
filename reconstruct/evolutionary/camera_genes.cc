#include "reconstruct/evolutionary/camera_genes.h"

#include <Eigen/Dense>
#include <cmath>

namespace flamefield {

namespace {

std::vector<Eigen::Vector3d> points_of(const Grid& domain) {
  std::vector<Eigen::Vector3d> out;
  const Eigen::Vector3d lower = domain.lower_mm(), size = domain.upper_mm() - lower;
  for (int i = 0; i < 27; ++i)
    out.push_back(lower + size.cwiseProduct(Eigen::Vector3d(i % 3, i / 3 % 3, i / 9) * 0.4 +
                                            Eigen::Vector3d::Constant(0.1)));
  return out;
}

Eigen::Vector3d centre_of(const Grid& domain) {
  return 0.5 * (domain.lower_mm() + domain.upper_mm());
}

}  // namespace

Camera corrected(const Camera& camera, const CameraGenes& genes, const Grid& domain) {
  const Eigen::Vector3d centre = camera.camera_from_world * centre_of(domain);
  const double distance_mm = centre.norm(), radius_mm = 0.5 * (domain.upper_mm() - domain.lower_mm()).norm();
  const double radius_px = camera.fx_px * radius_mm / distance_mm, mm_per_px = distance_mm / camera.fx_px;
  const auto& px = genes.px;
  const Eigen::Vector3d turn(px[CameraGenes::Pitch] / camera.fy_px, px[CameraGenes::Yaw] / camera.fx_px,
                             px[CameraGenes::Roll] / radius_px);
  const double angle = turn.norm();
  Rigid3 camera_from_old;
  if (angle > 0) camera_from_old.rotation = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
  camera_from_old.translation_mm =
      Eigen::Vector3d(px[CameraGenes::Right] * mm_per_px, px[CameraGenes::Down] * mm_per_px,
                      px[CameraGenes::Forward] * distance_mm / radius_px);
  Camera out = camera;
  out.camera_from_world = camera_from_old * camera.camera_from_world;
  const double growth = std::exp(px[CameraGenes::Focal] / radius_px);
  out.fx_px *= growth;
  out.fy_px *= growth;
  out.cx_px += px[CameraGenes::CentreX];
  out.cy_px += px[CameraGenes::CentreY];
  return out;
}

void keep_gauge(std::span<Camera> cameras, std::span<const Camera> trusted, const Grid& domain) {
  // A point p of the trusted world appears at p + u(p) in the corrected one, u = shift + turn x p + growth p.
  constexpr int kUnknowns = 7;
  Eigen::Matrix<double, kUnknowns, kUnknowns> normal = Eigen::Matrix<double, kUnknowns, kUnknowns>::Zero();
  Eigen::Matrix<double, kUnknowns, 1> right = Eigen::Matrix<double, kUnknowns, 1>::Zero();
  const Eigen::Vector3d centre = centre_of(domain);
  const double radius_mm = 0.5 * (domain.upper_mm() - domain.lower_mm()).norm();
  const auto moved = [&](const Eigen::Matrix<double, kUnknowns, 1>& u, const Eigen::Vector3d& p) {
    const Eigen::Vector3d q = p - centre;
    return Eigen::Vector3d(p + u.head<3>() + u.segment<3>(3).cross(q) / radius_mm + u[6] * q / radius_mm);
  };
  for (std::size_t v = 0; v < cameras.size(); ++v)
    for (const Eigen::Vector3d& p : points_of(domain)) {
      const auto was = project(trusted[v], p), is = project(cameras[v], p);
      if (!was || !is) continue;
      Eigen::Matrix<double, 2, kUnknowns> rows;
      for (int k = 0; k < kUnknowns; ++k) {
        constexpr double kStep_mm = 1e-3;
        Eigen::Matrix<double, kUnknowns, 1> u = Eigen::Matrix<double, kUnknowns, 1>::Zero();
        u[k] = kStep_mm;
        const auto there = project(trusted[v], moved(u, p));
        rows.col(k) = there ? Eigen::Vector2d((*there - *was) / kStep_mm) : Eigen::Vector2d::Zero();
      }
      normal += rows.transpose() * rows;
      right += rows.transpose() * (*is - *was);
    }
  normal.diagonal().array() += 1e-9 * normal.trace();
  const Eigen::Matrix<double, kUnknowns, 1> u = normal.ldlt().solve(right);
  // Undo it: the corrected camera sees p where a camera moved with u would have seen it.
  const Eigen::Vector3d turn = u.segment<3>(3) / radius_mm;
  const double angle = turn.norm(), growth = 1 + u[6] / radius_mm;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  if (angle > 0) rotation = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
  // q = centre + shift + growth rotation (p - centre); its inverse is put before the camera. Growth of the
  // world by g is a camera that stands g times as far.
  Rigid3 rigid{rotation, centre + u.head<3>() - rotation * centre};
  for (Camera& camera : cameras) {
    camera.camera_from_world = camera.camera_from_world * rigid.inverse();
    const Eigen::Vector3d seen = camera.camera_from_world * centre;
    camera.camera_from_world.translation_mm += (growth - 1) * seen;
  }
}

double mean_shift_px(const Camera& a, const Camera& b, const Grid& domain) {
  double sum = 0;
  int points = 0;
  for (const Eigen::Vector3d& p : points_of(domain)) {
    const auto there = project(a, p), here = project(b, p);
    if (!there || !here) continue;
    sum += (*there - *here).norm();
    ++points;
  }
  return points > 0 ? sum / points : 0;
}

}  // namespace flamefield
