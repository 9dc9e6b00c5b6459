// What each picture of the board was good for, how the cameras hang together, and what the result is worth.
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "calibrate/calibrate.h"
#include "calibrate/compare.h"
#include "services/report/html.h"
#include "services/report/plot.h"
#include "services/report/report_sections.h"

namespace flamefield {
namespace {

std::string chip(Verdict verdict) {
  switch (verdict) {
    case Verdict::Green:
      return "<span class=\"chip good\">✓ green</span>";
    case Verdict::Amber:
      return "<span class=\"chip fair\">~ amber</span>";
    case Verdict::Red:
      break;
  }
  return "<span class=\"chip poor\">✗ red</span>";
}

std::string percent(double share) {
  return concat(std::lround(100 * share));
}

std::string summary_table(const CalibrationReport& r) {
  std::vector<std::vector<std::string>> rows = {{"", "Value", "Unit", "What it means"}};
  const VolumeError& error = r.expected_volume_error;
  rows.push_back(
      {"Expected error in the measuring volume", concat("<strong>", number(error.mean_px), "</strong>"), "px",
       concat("mean over the cameras, ", number(r.expected_volume_error_mm, 2), " mm at the burner")});
  rows.push_back(
      {concat("Worst camera, ", escaped(error.worst_camera)),
       concat("<strong>", number(error.worst_px), "</strong> ", chip(verdict_of(error))), "px",
       "green up to 0.2, amber up to 0.5; 0.5 px per view raise the error of a 1.6 mm flame front by 30 %"});
  if (r.split_half) {
    rows.push_back({"Two calibrations from half of the poses each differ by",
                    number(r.split_half->volume.mean_px), "px",
                    concat(number(r.split_half->translation_mm, 2), " mm and ",
                           number(r.split_half->rotation_rad * 180 / std::numbers::pi, 2),
                           "° RMS; millimetres along the line of sight hardly move a pixel")});
  }
  rows.push_back({"Errors beyond independent corners", number(r.clustering, 2), "×",
                  "corners of one picture err alike; this factor is contained in all expected errors and σ"});
  rows.push_back({"Noise of a corner coordinate", number(r.sigma_px), "px",
                  concat("RMS ", number(r.rms_px), " px per corner, ", r.rejected_corners, " of ",
                         r.corners + r.rejected_corners, " corners rejected")});
  if (r.turned_views > 0) {
    rows.push_back({"Pictures renumbered", concat(r.turned_views), "count",
                    "the board looks the same from its other end; the others told which is which"});
  }
  if (r.bow_sigma_mm.norm() > 0) {
    rows.push_back({"Board bow along columns, rows",
                    concat(number(r.bow_mm.x(), 2), ", ", number(r.bow_mm.y(), 2)), "mm",
                    concat("± ", number(r.bow_sigma_mm.x(), 1), ", ", number(r.bow_sigma_mm.y(), 1),
                           "; how far the middle lies behind the edges")});
  }
  rows.push_back({"Measuring volume within a square of a corner", percent(r.coverage.volume), "%",
                  "elsewhere the result is extrapolated"});
  return table(rows, "headline");
}

// Camera by pose: RMS in hundredths of a pixel, or a letter that stands for the reason.
std::string matrix_table(const CalibrationReport& r, std::map<std::string, std::pair<char, int>>& legend) {
  std::vector<std::vector<std::string>> rows(1 + r.cameras.size());
  rows[0].push_back("Camera");
  for (std::size_t p = 0; p < r.poses.size(); ++p) rows[0].push_back(concat(p));
  for (std::size_t c = 0; c < r.cameras.size(); ++c) {
    rows[c + 1].push_back(escaped(r.cameras[c]));
    rows[c + 1].resize(1 + r.poses.size());
  }
  for (const ViewReport& view : r.views) {
    const auto c = static_cast<std::size_t>(std::ranges::find(r.cameras, view.camera) - r.cameras.begin());
    const auto p = static_cast<std::size_t>(std::ranges::find(r.poses, view.pose) - r.poses.begin());
    std::string& cell = rows[c + 1][p + 1];
    if (view.is_used()) {
      const double limit = 3 * std::max(r.rms_px, 1e-9);
      cell = concat("<span class=\"chip ", view.rms_px > limit ? "poor" : "good", "\" title=\"",
                    escaped(view.pose), ": ", number(view.rms_px), " px, ", view.rejected, " rejected\">",
                    std::lround(100 * view.rms_px), view.rejected > 0 ? "·" : "", "</span>");
      continue;
    }
    // "too dark: 99 % of ..." and the like share a letter.
    const std::string kind = view.reason.substr(0, view.reason.find_first_of(":("));
    const auto next = static_cast<char>('A' + legend.size() % 26);
    auto& [letter, count] = legend.try_emplace(kind, next, 0).first->second;
    ++count;
    cell = concat("<span class=\"chip\" title=\"", escaped(view.pose), ": ", escaped(view.reason), "\">",
                  letter, "</span>");
  }
  return table(rows, "numbers");
}

std::string legend_text(const std::map<std::string, std::pair<char, int>>& legend) {
  std::string out =
      "<p class=\"why\">Numbers: RMS residual in hundredths of a pixel; a dot: corners were rejected. ";
  for (const auto& [reason, entry] : legend)
    out += concat(entry.first, " = ", escaped(reason), " (", entry.second, " pictures). ");
  return out + "Point at a cell for its reason.</p>";
}

// Cameras on a circle, joined where they share board poses.
std::string graph_svg(const CalibrationReport& r) {
  constexpr double kSize = 420, kRadius = 165;
  std::map<std::string, Eigen::Vector2d> at;
  const auto count = static_cast<double>(r.cameras.size());
  for (std::size_t c = 0; c < r.cameras.size(); ++c) {
    const double phi = 2 * std::numbers::pi * static_cast<double>(c) / count;
    at[r.cameras[c]] = {kSize / 2 + kRadius * std::sin(phi), kSize / 2 - kRadius * std::cos(phi)};
  }
  const auto line = [&](const std::string& a, const std::string& b, const std::string& style) {
    return concat("<line x1=\"", number(at[a].x(), 4), "\" y1=\"", number(at[a].y(), 4), "\" x2=\"",
                  number(at[b].x(), 4), "\" y2=\"", number(at[b].y(), 4), "\" ", style, "/>");
  };
  int most = 1;
  for (const SharedPoses& pair : r.pairs) most = std::max(most, pair.poses);
  std::string out = concat("<svg viewBox=\"0 0 ", kSize, " ", kSize, "\" role=\"img\">");
  for (const SharedPoses& pair : r.pairs) {
    const double share = static_cast<double>(pair.poses) / most;
    out += line(pair.a, pair.b,
                concat("stroke=\"", kBlue, "\" stroke-opacity=\"", number(0.1 + 0.6 * share, 2),
                       "\" stroke-width=\"", number(0.5 + 4 * share * share, 2), "\""));
  }
  for (const MissingLink& link : r.missing_links) {
    out += line(link.connected, link.loose,
                concat("stroke=\"", kRed, "\" stroke-width=\"3\" stroke-dasharray=\"7 5\""));
  }
  for (const auto& [name, p] : at) {
    const bool loose = std::ranges::find(r.unconnected, name) != r.unconnected.end();
    const Eigen::Vector2d text =
        Eigen::Vector2d(kSize / 2, kSize / 2) + 1.16 * (p - Eigen::Vector2d(kSize / 2, kSize / 2));
    out += concat("<circle cx=\"", number(p.x(), 4), "\" cy=\"", number(p.y(), 4), "\" r=\"6\" fill=\"",
                  loose ? kRed : kBlue, "\"/><text class=\"tic\" text-anchor=\"middle\" x=\"",
                  number(text.x(), 4), "\" y=\"", number(text.y() + 4, 4), "\">", escaped(name), "</text>");
  }
  return out + "</svg>";
}

// Mean residual by place in the image, all cameras laid upon each other.
Plot arrow_plot(const CalibrationReport& r, double* factor) {
  constexpr int kAcross = 14, kDown = 10;
  struct Cell {
    Eigen::Vector2d place{0, 0}, residual{0, 0};
    int count = 0;
  };
  std::vector<Cell> cells(kAcross * kDown);
  double width = 1, height = 1;
  for (const Camera& c : r.rig.cameras) {
    width = std::max(width, double(c.image_width_px));
    height = std::max(height, double(c.image_height_px));
  }
  for (const ViewReport& view : r.views) {
    for (std::size_t i = 0; i < view.residuals_px.size(); ++i) {
      if (!view.used[i]) continue;
      const Eigen::Vector2d& p = view.corners_px[i];
      const int x = std::clamp(static_cast<int>(kAcross * p.x() / width), 0, kAcross - 1),
                y = std::clamp(static_cast<int>(kDown * p.y() / height), 0, kDown - 1);
      Cell& cell = cells[static_cast<std::size_t>(y * kAcross + x)];
      cell.place += p;
      cell.residual += view.residuals_px[i];
      ++cell.count;
    }
  }
  double longest = 1e-9;
  for (const Cell& cell : cells)
    if (cell.count >= 5) longest = std::max(longest, cell.residual.norm() / cell.count);
  *factor = std::pow(10, std::floor(std::log10(width / kAcross * 1.5 / longest)));
  Series tails{"", {}, {}, Mark::Points, kBlue}, shafts{"mean residual", {}, {}, Mark::Line, kRed};
  for (const Cell& cell : cells) {
    if (cell.count < 5) continue;
    const Eigen::Vector2d from = cell.place / cell.count, to = from + *factor * cell.residual / cell.count;
    tails.x.push_back(from.x()), tails.y.push_back(height - from.y());
    shafts.x.insert(shafts.x.end(), {from.x(), to.x(), kUnknown});
    shafts.y.insert(shafts.y.end(), {height - from.y(), height - to.y(), kUnknown});
  }
  Plot plot{.x_label = "column (px)", .y_label = "height above the lower edge (px)"};
  plot.x_range = {{0, width}};
  plot.y_range = {{0, height}};
  plot.series = {shafts, tails};
  plot.equal_axes = true;
  plot.height_px = 420;
  return plot;
}

// Around the outer surface of the volume, as points_of() walks it.
Plot volume_plot(const CalibrationReport& r) {
  Plot plot{.x_label = "azimuth (°)", .y_label = "height (mm)"};
  Cells cells;
  const std::vector<Eigen::Vector3d> points = points_of(r.volume);
  double high = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d d = points[i] - r.volume.centre_mm;
    if (std::hypot(d.x(), d.z()) < 0.49 * r.volume.diameter_mm) continue;
    double azimuth = std::atan2(d.z(), d.x()) * 180 / std::numbers::pi;
    if (azimuth < -1e-6) azimuth += 360;
    cells.x.push_back(azimuth);
    cells.y.push_back(points[i].y());
    cells.value.push_back(r.volume_map_px[i]);
    high = std::max(high, r.volume_map_px[i]);
  }
  cells.range = {0, high > 0 ? high : 1};
  cells.width = 28;
  cells.height = 0.23 * r.volume.height_mm;
  plot.x_range = {{-16, 346}};
  plot.y_range = {{r.volume.centre_mm.y() - 0.63 * r.volume.height_mm,
                   r.volume.centre_mm.y() + 0.63 * r.volume.height_mm}};
  plot.cells = std::move(cells);
  return plot;
}

// By how much each camera points elsewhere than in the calibration before.
std::string comparison_table(const ReportCalibration& c) {
  if (!c.comparison) return {};
  std::vector<std::vector<std::string>> rows = {{"Camera", "Shift in the measuring volume (px)", ""}};
  for (const CameraShift& camera : c.comparison->cameras)
    rows.push_back({escaped(camera.camera), number(camera.shift_px),
                    camera.moved ? "<span class=\"chip poor\">✗ moved</span>" : ""});
  std::string others;
  for (const std::string& name : c.comparison->added) others += concat(" ", escaped(name), " is new.");
  for (const std::string& name : c.comparison->missing) others += concat(" ", escaped(name), " is gone.");
  return concat("<h3>Since ", escaped(c.compared_with),
                "</h3><p class=\"why\">The worlds of both are laid upon each "
                "other by the cameras that agree: the board on the burner stood ",
                number(c.comparison->world_shift_mm, 2), " mm and ",
                number(c.comparison->world_turn_rad * 180 / std::numbers::pi, 2), "° elsewhere.", others,
                "</p>", table(rows, "numbers"));
}

// A picture with its corners: circles where they were used, crosses where they were rejected, and lines that
// show the residual enlarged.
std::string overlay_svg(const ReportOverlay& overlay, const ViewReport& view) {
  constexpr double kEnlarged = 100;
  const Image& image = overlay.image;
  const auto [low, high] = std::ranges::minmax(image.pixels);
  ColourMap grey;
  for (std::size_t i = 0; i < grey.size(); ++i) grey[i].fill(static_cast<std::uint8_t>(i));
  std::string out =
      concat("<svg viewBox=\"0 0 ", image.width_px, " ", image.height_px, "\" role=\"img\"><image width=\"",
             image.width_px, "\" height=\"", image.height_px, "\" href=\"data:image/png;base64,",
             base64(png_from(coloured(image, grey, {low, high}))), "\"/>");
  for (std::size_t i = 0; i < view.residuals_px.size(); ++i) {
    if (!view.corners_px[i].allFinite()) continue;
    const Eigen::Vector2d p = view.corners_px[i] + Eigen::Vector2d(0.5, 0.5);
    const Eigen::Vector2d to = p + kEnlarged * view.residuals_px[i];
    if (view.used[i]) {
      out += concat("<circle cx=\"", number(p.x(), 5), "\" cy=\"", number(p.y(), 5),
                    "\" r=\"3\" fill=\"none\" stroke=\"", kGreen, "\" stroke-width=\"1.5\"/>");
      out +=
          concat("<line x1=\"", number(p.x(), 5), "\" y1=\"", number(p.y(), 5), "\" x2=\"", number(to.x(), 5),
                 "\" y2=\"", number(to.y(), 5), "\" stroke=\"", kOrange, "\" stroke-width=\"1.5\"/>");
    } else {
      out += concat("<path d=\"M", number(p.x() - 4, 5), " ", number(p.y() - 4, 5),
                    "l8 8m0 -8l-8 8\" stroke=\"", kRed, "\" stroke-width=\"2\"/>");
    }
  }
  return out + "</svg>";
}

std::string overlay_figures(const ReportCalibration& c) {
  std::string out;
  for (const ReportOverlay& overlay : c.overlays) {
    const auto view = std::ranges::find_if(c.session->views, [&](const ViewReport& v) {
      return v.camera == overlay.camera && v.pose == overlay.pose;
    });
    if (view == c.session->views.end() || overlay.image.pixels.empty()) continue;
    out += figure(
        overlay_svg(overlay, *view),
        concat(overlay.camera, ", ", overlay.pose, ": ",
               view->is_used() ? concat("RMS ", number(view->rms_px), " px, ", view->rejected, " rejected")
                               : view->reason));
  }
  if (out.empty()) return out;
  return concat(
      "<h3>Pictures with the largest residuals</h3><p class=\"why\">Circles: corners used. Crosses: "
      "rejected. "
      "Lines: residuals, 100 times too long.</p><div class=\"plots\">",
      out, "</div>");
}

// Where each camera stands against a ring of even spacing through all of them.
std::string ring_table(const CalibrationReport& r) {
  const std::size_t n = r.rig.cameras.size();
  std::vector<double> azimuth, radius;
  for (const Camera& camera : r.rig.cameras) {
    const Eigen::Vector3d c = camera.centre_mm();
    double phi = std::atan2(c.z(), c.x()) * 180 / std::numbers::pi;
    while (!azimuth.empty() && phi < azimuth.back() - 180) phi += 360;
    while (!azimuth.empty() && phi > azimuth.back() + 180) phi -= 360;
    azimuth.push_back(phi);
    radius.push_back(std::hypot(c.x(), c.z()));
  }
  double mean_k = 0, mean_phi = 0, top = 0, bottom = 0;  // the straight line phi = a + b k
  for (std::size_t k = 0; k < n; ++k) {
    mean_k += static_cast<double>(k) / static_cast<double>(n);
    mean_phi += azimuth[k] / static_cast<double>(n);
  }
  for (std::size_t k = 0; k < n; ++k) {
    top += (static_cast<double>(k) - mean_k) * (azimuth[k] - mean_phi);
    bottom += (static_cast<double>(k) - mean_k) * (static_cast<double>(k) - mean_k);
  }
  const double step = bottom > 0 ? top / bottom : 0;
  std::vector<std::vector<std::string>> rows = {{"Camera", "Expected error in the volume (px)",
                                                 "Image covered (%)", "Azimuth (°)", "Off even spacing (°)",
                                                 "Distance from the axis (mm)", "Height (mm)"}};
  for (std::size_t k = 0; k < n; ++k) {
    const Camera& camera = r.rig.cameras[k];
    const double error = k < r.camera_volume_px.size() ? r.camera_volume_px[k] : kUnknown;
    const double even = mean_phi + step * (static_cast<double>(k) - mean_k);
    const double off = std::round(1e4 * (azimuth[k] - even)) / 1e4;
    rows.push_back({escaped(camera.name),
                    concat(number(error), " ", chip(verdict_of({error, error, camera.name}))),
                    k < r.coverage.image.size() ? percent(r.coverage.image[k]) : "–", number(azimuth[k], 4),
                    number(off, 2), number(radius[k], 4), number(camera.centre_mm().y(), 3)});
  }
  return concat("<p class=\"why\">Even spacing: ", number(std::abs(step), 4), "° between neighbours.</p>",
                table(rows, "numbers"));
}

}  // namespace

Result<std::string> board_session_section(const ReportData& data) {
  if (!data.calibration || !data.calibration->session) return std::string();
  const CalibrationReport& r = *data.calibration->session;
  if (r.rig.cameras.empty() || r.views.empty()) return std::string();
  double factor = 1;
  const auto arrows = svg_of(arrow_plot(r, &factor), "arrows");
  if (!arrows) return tl::unexpected(arrows.error());
  std::string plots = figure(
      graph_svg(r), concat("Cameras that share board poses; the thickest line stands for the "
                           "most poses.",
                           r.missing_links.empty() ? "" : " Dashed: a pose that both see is missing."));
  plots +=
      figure(*arrows, concat("Mean residual by place in the image, all cameras laid upon each other, drawn ",
                             factor, " times too long. Order here means that the lens model falls short."));
  if (!r.volume_map_px.empty()) {
    const Plot map = volume_plot(r);
    const auto svg = svg_of(map, "volume_error");
    if (!svg) return tl::unexpected(svg.error());
    plots += figure(
        *svg, concat("Expected error around the surface of the measuring volume, RMS over the cameras, from "
                     "0 (black) to ",
                     number(map.cells->range.high), " px (pale yellow)."));
  }
  std::map<std::string, std::pair<char, int>> legend;
  const std::string matrix = matrix_table(r, legend);
  return section(
      "What the calibration is worth",
      "By how much the calibrated cameras are expected to miss points of the measuring volume, and what "
      "each picture of the board contributed.",
      concat(summary_table(r), "<div class=\"plots\">", plots, "</div>", ring_table(r),
             comparison_table(*data.calibration), "<h3>Pictures</h3>", legend_text(legend), matrix,
             overlay_figures(*data.calibration)));
}

}  // namespace flamefield
