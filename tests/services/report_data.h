#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

#include "services/report/report.h"
#include "services/report/rgb_image.h"

namespace flamefield {

// A wrinkled conical sheet that leans with the phase: something that looks like a flame, without the
// phantoms.
inline Volume report_flame(int nx, int ny, int nz, double phase_rad, double blur) {
  Volume volume(centred_grid(nx, ny, nz, 1.32));
  volume.grid.origin_mm.y() = 0.5 * 1.32;
  for (int z = 0; z < nz; ++z) {
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) {
        const Eigen::Vector3d p = volume.grid.voxel_centre_mm(x, y, z);
        const double angle = std::atan2(p.z(), p.x()), hab_mm = p.y();
        const double front =
            6 + 0.28 * hab_mm + 0.03 * hab_mm * std::sin(3 * angle + phase_rad + 0.12 * hab_mm);
        const double d = (std::hypot(p.x(), p.z()) - front) / blur;
        volume.at(x, y, z) =
            static_cast<float>(std::exp(-d * d) * (0.75 + 0.25 * std::cos(2 * angle - phase_rad)) *
                               std::min(1.0, (75 - hab_mm) / 25));
      }
    }
  }
  return volume;
}

inline Rig report_rig(int views, double error_mm) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0, error_mm);
  Rig rig;
  for (int i = 0; i < views; ++i) {
    const double phi = 12 * i * std::numbers::pi / 180;
    Camera camera;
    camera.name = concat("cam", i < 10 ? "0" : "", i);
    camera.image_width_px = 659, camera.image_height_px = 494;
    camera.fx_px = camera.fy_px = 1620;
    camera.cx_px = 329, camera.cy_px = 246.5;
    const Eigen::Vector3d centre(300 * std::cos(phi) + normal(random), 36 + normal(random),
                                 300 * std::sin(phi) + normal(random));
    const Eigen::Vector3d forward = Eigen::Vector3d(-std::cos(phi), 0, -std::sin(phi));
    const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitY());
    camera.camera_from_world.rotation << right.transpose(), -Eigen::RowVector3d::UnitY(), forward.transpose();
    camera.camera_from_world.translation_mm = -(camera.camera_from_world.rotation * centre);
    rig.cameras.push_back(camera);
  }
  return rig;
}

// Stand-ins for metrics: only their place on the page matters here.
inline FieldMetrics report_metrics(const Grid& grid) {
  FieldMetrics m{
      .pearson = 0.9684, .sqmd = 0.0812, .rmse = 0.0341, .psnr_db = 29.3, .ssim = 0.941, .slices = {}};
  const std::array<int, 3> size = {grid.nx, grid.ny, grid.nz};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (int i = 0; i < size[axis]; ++i) {
      const double u = static_cast<double>(i) / size[axis];
      m.slices[axis].push_back({i, 0.985 - 0.08 * u * u + 0.008 * std::sin(i), 0.05 + 0.1 * u * u});
    }
  }
  m.slices[1].back() = {grid.ny - 1, kUnknown, kUnknown};  // an empty slice has no correlation
  return m;
}

// A full measurement, small: every part of the report has something to show.
inline ReportData report_data(int views = 15, int pulses = 30, int nx = 52, int ny = 55) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  ReportData data;
  data.title = "Stratified flame <15 cameras> & a burst";
  data.subtitle = "simulated array, 659 × 494 px, 8 bit";
  data.created = "2026-03-01 10:15:00 UTC";
  data.pulses = data.sets = data.volumes = pulses;
  data.pulse_period_ms = 200;
  data.job_wall_s = 96.4;
  const Volume truth = report_flame(nx, ny, nx, 0, 1.8);
  ReportField field{.label = "pulse 17",
                    .volume = report_flame(nx, ny, nx, 0.05, 2.0),
                    .truth = truth,
                    .metrics = report_metrics(truth.grid),
                    .view_names = {},
                    .residual_per_view = {},
                    .history = {}};
  for (float& v : field.volume.values) v = std::max(0.0f, v + 0.02f * static_cast<float>(normal(random)));
  for (int i = 1; i <= 40; ++i) field.history.push_back({i, 0.04 + 0.9 * std::exp(-0.2 * i)});
  ReportCalibration calibration{.rig = report_rig(views, 0.05),
                                .true_rig = report_rig(views, 0),
                                .volume_error_mean_px = 0.047,
                                .volume_error_worst_px = 0.083,
                                .volume_error_worst_camera = "cam03",
                                .rms_px = {},
                                .residuals_px = {}};
  calibration.rig.quality = RigQuality{.rms_px = 0.094, .board_poses = 24, .cameras = {}};
  Image raw(659, 494);
  for (int y = 0; y < 494; ++y) {
    for (int x = 0; x < 659; ++x) {
      const double u = (x - 329) / 90.0, v = (y - 260) / 160.0;
      raw.at(x, y) =
          static_cast<float>(std::round(8 + 190 * std::exp(-u * u - v * v * v * v) + 3 * normal(random)));
    }
  }
  for (int i = 0; i < views; ++i) {
    const std::string name = calibration.rig.cameras[static_cast<std::size_t>(i)].name;
    field.view_names.push_back(name);
    field.residual_per_view.push_back(0.05 + 0.008 * std::abs(normal(random)));
    calibration.rig.quality->cameras.push_back(
        {20, 1080, 2, 0.09 + 0.01 * normal(random), 0.31, 0.021, 0.00011});
    calibration.rms_px.emplace_back();
    for (int pose = 0; pose < 24; ++pose) {
      calibration.rms_px.back().push_back(
          (i * 7 + pose * 3) % 11 == 0 ? kUnknown : 0.09 + 0.02 * std::abs(normal(random)));
    }
    ReportImages images{name, {}, 255, Image(nx, ny)};
    images.raw = raw;
    images.prepared = resized(images.raw, nx, ny);
    data.images.push_back(std::move(images));
    data.receipts.push_back({name, pulses, pulses - (i == 3), {{"incomplete", i == 3}, {"missed", 0}}});
  }
  for (int i = 0; i < 8000; ++i)
    calibration.residuals_px.push_back(static_cast<float>(0.066 * normal(random)));
  for (int i = 0; i < pulses; ++i) {
    data.per_pulse.push_back({i, 0.96 + 0.006 * normal(random), 0.09 + 0.01 * normal(random),
                              0.05 + 0.002 * normal(random), 9 + 2 * std::abs(normal(random)),
                              2100 + 300 * std::abs(normal(random))});
    if (i % 3 == 0) data.film.push_back({i, report_flame(nx / 2, ny / 2, nx / 2, 0.3 * i, 3)});
  }
  data.per_pulse.back().pearson = kUnknown;  // its volume failed
  data.preparation = {"mean of 20 dark frames subtracted", "crop 412 × 430 px, area average 8 × 8"};
  data.parameters = {{"flamefield", "0.1.0"},
                     {"recipe", "mlem 40 iterations (6f1e2d3c4b5a6978)"},
                     {"rig", "1122334455667788"},
                     {"host", "burner-lab"},
                     {"seed", "1"}};
  data.commands = {"flamefield capture burst --pulses 30",
                   "flamefield reprocess --where 'run > 3' --recipe mlem.toml"};
  data.field = std::move(field);
  data.calibration = std::move(calibration);
  return data;
}

}  // namespace flamefield
