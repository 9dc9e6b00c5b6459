// How well the cameras are known.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "services/report/html.h"
#include "services/report/plot.h"
#include "services/report/report_sections.h"

namespace flamefield {
namespace {

std::vector<std::string> names_of(const Rig& rig) {
  std::vector<std::string> names;
  for (const Camera& camera : rig.cameras) names.push_back(camera.name);
  return names;
}

Plot rms_plot(const Rig& rig) {
  Plot plot{.x_label = "camera", .y_label = "RMS residual (px)"};
  plot.x_names = names_of(rig);
  Series bars{"", {}, {}, Mark::Bars, kBlue};
  for (const CameraQuality& q : rig.quality->cameras) {
    bars.x.push_back(static_cast<double>(bars.x.size()));
    bars.y.push_back(q.rms_px);
  }
  plot.x_range = {{-0.7, static_cast<double>(bars.x.size()) - 0.3}};
  plot.y_range = {{0, std::max(1e-6, 1.15 * std::ranges::max(bars.y))}};
  plot.series = {bars,
                 {"all cameras",
                  {-0.7, static_cast<double>(bars.x.size()) - 0.3},
                  {rig.quality->rms_px, rig.quality->rms_px},
                  Mark::Dashed,
                  kOrange}};
  return plot;
}

Plot matrix_plot(const ReportCalibration& c) {
  Plot plot{.x_label = "board pose (number)", .y_label = "camera"};
  plot.y_names = names_of(c.rig);
  Cells cells;
  std::size_t poses = 0;
  double high = 0;
  for (std::size_t camera = 0; camera < c.rms_px.size(); ++camera) {
    poses = std::max(poses, c.rms_px[camera].size());
    for (std::size_t pose = 0; pose < c.rms_px[camera].size(); ++pose) {
      cells.x.push_back(static_cast<double>(pose));
      cells.y.push_back(static_cast<double>(camera));
      cells.value.push_back(c.rms_px[camera][pose]);
      if (std::isfinite(cells.value.back())) high = std::max(high, cells.value.back());
    }
  }
  cells.range = {0, high > 0 ? high : 1};
  cells.width = cells.height = 0.92;
  plot.x_range = {{-0.6, static_cast<double>(poses) - 0.4}};
  plot.y_range = {{-0.6, static_cast<double>(c.rms_px.size()) - 0.4}};
  plot.cells = std::move(cells);
  plot.height_px = 420;
  return plot;
}

// From above, x to the right and z up: where the cameras stand, and the deviations drawn so much larger that
// the largest is a tenth of the ring.
Plot ring_plot(const ReportCalibration& c, double* exaggeration) {
  Plot plot{.x_label = "x (mm)", .y_label = "z (mm)"};
  Series estimated{"estimated", {}, {}, Mark::Points, kBlue},
      truth{"true", {}, {}, Mark::OpenPoints, kOrange};
  Series looks{"line of sight", {}, {}, Mark::Line, kGrey}, deviation{"deviation", {}, {}, Mark::Line, kRed};
  double largest_mm = 0, radius_mm = 0;
  for (const Camera& camera : c.rig.cameras) {
    radius_mm = std::max(radius_mm, camera.centre_mm().norm());
    if (!c.true_rig) continue;
    if (const auto i = c.true_rig->find(camera.name)) {
      largest_mm = std::max(largest_mm, (camera.centre_mm() - c.true_rig->cameras[*i].centre_mm()).norm());
    }
  }
  *exaggeration = largest_mm > 0 ? std::pow(10, std::floor(std::log10(0.3 * radius_mm / largest_mm))) : 1;
  for (const Camera& camera : c.rig.cameras) {
    const Eigen::Vector3d centre = camera.centre_mm();
    const Eigen::Vector3d ahead =
        centre + 0.25 * radius_mm * camera.camera_from_world.rotation.row(2).transpose();
    looks.x.insert(looks.x.end(), {centre.x(), ahead.x(), kUnknown});
    looks.y.insert(looks.y.end(), {centre.z(), ahead.z(), kUnknown});
    const auto i = c.true_rig ? c.true_rig->find(camera.name) : std::nullopt;
    if (!i) {
      estimated.x.push_back(centre.x()), estimated.y.push_back(centre.z());
      continue;
    }
    const Eigen::Vector3d at = c.true_rig->cameras[*i].centre_mm();
    const Eigen::Vector3d shown = at + *exaggeration * (centre - at);
    truth.x.push_back(at.x()), truth.y.push_back(at.z());
    estimated.x.push_back(shown.x()), estimated.y.push_back(shown.z());
    deviation.x.insert(deviation.x.end(), {at.x(), shown.x(), kUnknown});
    deviation.y.insert(deviation.y.end(), {at.z(), shown.z(), kUnknown});
  }
  plot.series = {looks, deviation, truth, estimated, {"burner", {0}, {0}, Mark::Points, kGreen}};
  // A margin, so that no camera sits on the frame.
  const auto padded = [&](const std::vector<double>& a, const std::vector<double>& b) {
    std::array<double, 2> range = {0, 0};  // the burner
    for (const auto* values : {&a, &b}) {
      for (double v : *values) range = {std::min(range[0], v), std::max(range[1], v)};
    }
    return std::array<double, 2>{range[0] - 0.08 * radius_mm, range[1] + 0.08 * radius_mm};
  };
  plot.x_range = padded(estimated.x, truth.x);
  plot.y_range = padded(estimated.y, truth.y);
  plot.equal_axes = true;
  plot.height_px = 420;
  return plot;
}

Plot histogram_plot(const std::vector<float>& residuals_px, double* sigma_px) {
  double squares = 0;
  for (float r : residuals_px) squares += static_cast<double>(r) * static_cast<double>(r);
  const auto n = static_cast<double>(residuals_px.size());
  *sigma_px = std::sqrt(squares / n);
  const double half = std::max(1e-9, 4 * *sigma_px), width = 2 * half / 48;
  Series bars{"corners", {}, std::vector<double>(48), Mark::Bars, kBlue},
      normal{"normal distribution of the same width", {}, {}, Mark::Line, kOrange};
  for (int i = 0; i < 48; ++i) bars.x.push_back(-half + (i + 0.5) * width);
  for (float r : residuals_px) {
    const double bin = std::floor((static_cast<double>(r) + half) / width);
    if (bin >= 0 && bin < 48) bars.y[static_cast<std::size_t>(bin)] += 1;
  }
  for (double x : bars.x) {
    const double z = x / std::max(1e-12, *sigma_px);
    normal.x.push_back(x);
    normal.y.push_back(n * width / (*sigma_px + 1e-12) / std::sqrt(2 * std::numbers::pi) *
                       std::exp(-0.5 * z * z));
  }
  Plot plot{.x_label = "residual in x or y (px)", .y_label = "corner coordinates (count)"};
  plot.x_range = {{-half, half}};
  plot.series = {bars, normal};
  return plot;
}

std::string quality_table(const Rig& rig) {
  std::vector<std::vector<std::string>> rows = {
      {"Camera", "Images (count)", "Corners (count)", "Rejected (count)", "RMS (px)", "f (px)",
       "σ focal length (px)", "σ position (mm)", "σ rotation (mrad)"}};
  for (std::size_t i = 0; i < std::min(rig.cameras.size(), rig.quality->cameras.size()); ++i) {
    const CameraQuality& q = rig.quality->cameras[i];
    rows.push_back({escaped(rig.cameras[i].name), concat(q.images), concat(q.corners),
                    concat(q.rejected_corners), number(q.rms_px), number(rig.cameras[i].fx_px, 5),
                    number(q.focal_sigma_px, 2), number(q.position_sigma_mm, 2),
                    number(1e3 * q.rotation_sigma_rad, 2)});
  }
  return table(rows, "numbers");
}

}  // namespace

Result<std::string> calibration_section(const ReportData& data) {
  if (!data.calibration || data.calibration->rig.cameras.empty()) return std::string();
  const ReportCalibration& c = *data.calibration;
  std::string plots, numbers;
  const auto add = [&](const Plot& plot, const std::string& name, const std::string& caption) -> Result<> {
    const auto svg = svg_of(plot, name);
    if (!svg) return tl::unexpected(svg.error());
    plots += figure(*svg, caption);
    return {};
  };
  double exaggeration = 1, sigma_px = 0;
  const Plot ring = ring_plot(c, &exaggeration);
  if (auto ok = add(ring, "ring",
                    c.true_rig ? concat("The ring from above; the deviation of the estimated from the true "
                                        "camera centres is drawn ",
                                        number(exaggeration, 1), " times too large.")
                               : "The ring from above, as estimated.");
      !ok)
    return tl::unexpected(ok.error());
  if (c.rig.quality && !c.rig.quality->cameras.empty()) {
    if (auto ok = add(rms_plot(c.rig), "rms", "Reprojection residual of each camera."); !ok)
      return tl::unexpected(ok.error());
    numbers = quality_table(c.rig);
  }
  if (!c.rms_px.empty()) {
    const Plot matrix = matrix_plot(c);
    const std::string caption =
        concat("RMS residual of every image from 0 (black) to ", number(matrix.cells->range.high),
               " px (pale yellow); a gap where the camera did not see the board.");
    if (auto ok = add(matrix, "poses", caption); !ok) return tl::unexpected(ok.error());
  }
  if (!c.residuals_px.empty()) {
    const Plot histogram = histogram_plot(c.residuals_px, &sigma_px);
    if (auto ok = add(histogram, "corners", concat("All corner residuals, σ = ", number(sigma_px), " px."));
        !ok)
      return tl::unexpected(ok.error());
  }
  return section("How well the cameras are known",
                 "Residuals of the board's corners, and what the adjustment itself says about its "
                 "uncertainty (one standard deviation, σ).",
                 concat("<div class=\"plots\">", plots, "</div>", numbers));
}

}  // namespace flamefield
