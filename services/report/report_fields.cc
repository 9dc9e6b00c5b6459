// The flame itself: film strip, slices beside the truth, and how well they agree.
#include <algorithm>
#include <cmath>

#include "services/report/field_plots.h"
#include "services/report/html.h"
#include "services/report/plot.h"
#include "services/report/report_sections.h"
#include "services/report/slice_figure.h"
#include "services/report/volume_view.h"

namespace flamefield {
namespace {

constexpr std::size_t kFilmFrames = 12;

const SliceMetrics* metrics_of(const ReportField& field, const Slice& slice, int index) {
  if (!field.metrics) return nullptr;
  const auto& list = field.metrics->slices[static_cast<std::size_t>(slice.normal)];
  const auto found = std::ranges::find(list, index, &SliceMetrics::index);
  return found == list.end() ? nullptr : &*found;
}

struct Cut {
  Axis axis;
  int index;
};

// The two vertical central planes, and horizontal ones at a quarter, half and three quarters of the height.
std::vector<Cut> cuts(const Grid& g) {
  std::vector<Cut> out = {{Axis::X, central_layer(g, Axis::X)}, {Axis::Z, central_layer(g, Axis::Z)}};
  for (int quarter = 1; quarter <= 3; ++quarter) out.push_back({Axis::Y, g.ny * quarter / 4});
  return out;
}

struct SliceRow {
  const Volume* volume;
  std::string name;
  const ColourMap* map;
  ValueRange range;
};

std::string slice_cell(const SliceRow& row, const Cut& cut, double px_per_mm, bool first, bool last) {
  const Slice s = slice(*row.volume, cut.axis, cut.index);
  SliceFigureOptions options{px_per_mm, last, true, ""};
  if (first) options.title = concat(label_of(cut.axis), " = ", number(s.position_mm, 2), " mm");
  return slice_svg(s, *row.map, row.range, options);
}

}  // namespace

std::string film_section(const ReportData& data) {
  if (data.film.empty()) return "";
  double high = 0;
  for (const ReportFrame& f : data.film) high = std::max(high, emission_range(f.volume.values).high);
  VolumeViewOptions view{.width_px = 230, .height_px = 270, .high = high};
  std::string content = "<div class=\"film\">";
  const std::size_t shown = std::min(kFilmFrames, data.film.size());
  for (std::size_t i = 0; i < shown; ++i) {
    const ReportFrame& f = data.film[shown == 1 ? 0 : i * (data.film.size() - 1) / (shown - 1)];
    const std::string name = concat("pulse ", f.pulse);
    content += figure(inline_image(volume_view(f.volume, view), "volume rendering of " + name), name);
  }
  content += concat("</div>", colour_bar_svg(inferno(), {0, high}, concat("emission (", data.unit, ")")));
  return section("The flame, pulse by pulse",
                 "Volume renderings of the reconstructed field, all to one scale.", content);
}

std::string slices_section(const ReportData& data) {
  if (!data.field) return "";
  const ReportField& field = *data.field;
  const Grid& g = field.volume.grid;
  ValueRange range = emission_range(field.volume.values);
  const Volume wrong = field.truth ? difference(field.volume, *field.truth) : Volume();
  std::vector<SliceRow> rows;
  if (field.truth) {
    range = emission_range(field.truth->values);
    rows.push_back({&*field.truth, "truth", &inferno(), range});
  }
  rows.push_back({&field.volume, "reconstruction", &inferno(), range});
  double largest = 1e-12 * range.high;
  for (float v : wrong.values) largest = std::max(largest, std::abs(static_cast<double>(v)));
  const ValueRange symmetric{-largest, largest};
  if (field.truth) rows.push_back({&wrong, "reconstruction − truth", &cool_warm(), symmetric});

  const Eigen::Vector3d size_mm = g.upper_mm() - g.lower_mm();
  const double px_per_mm = std::min(142 / std::max(size_mm.x(), size_mm.z()), 240 / size_mm.y());
  std::string content = "<div class=\"scroll\"><table class=\"slices\"><tbody>\n";
  for (std::size_t r = 0; r < rows.size(); ++r) {
    content += concat("<tr><th scope=\"row\">", rows[r].name, "</th>");
    for (const Cut& cut : cuts(g)) {
      content += concat("<td>", slice_cell(rows[r], cut, px_per_mm, r == 0, r + 1 == rows.size()), "</td>");
    }
    content += "</tr>\n";
    if (r != 0 || !field.metrics) continue;
    content += "<tr class=\"between\"><th scope=\"row\">Pearson<br/>SqMD</th>";
    for (const Cut& cut : cuts(g)) {
      const SliceMetrics* m = metrics_of(field, slice(field.volume, cut.axis, cut.index), cut.index);
      content +=
          m ? concat("<td>", number(m->pearson), "<br/>", number(m->sqmd), "</td>") : "<td>–<br/>–</td>";
    }
    content += "</tr>\n";
  }
  content += concat(
      "</tbody></table></div><div class=\"bars\">",
      colour_bar_svg(inferno(), range, concat("emission (", data.unit, ")")),
      field.truth ? colour_bar_svg(cool_warm(), symmetric, concat("difference (", data.unit, ")")) : "",
      "</div>");
  return section(
      field.truth ? "Truth and reconstruction, slice by slice" : "The reconstruction in slices",
      concat("Cuts through the field of ", field.label, "; one square is one voxel",
             field.truth ? ". Between the rows: correlation and normalised Manhattan distance of each pair."
                         : "."),
      content);
}

Result<std::string> field_plots_section(const ReportData& data) {
  if (!data.field || !data.field->truth || !data.field->metrics) return std::string();
  const auto height = svg_of(height_plot(data.field->volume.grid, *data.field->metrics), "hab");
  if (!height) return height;
  const auto scatter = svg_of(scatter_plot(*data.field->truth, data.field->volume, data.unit), "scatter");
  if (!scatter) return scatter;
  const FieldMetrics& m = *data.field->metrics;
  const std::string numbers =
      table({{"Pearson (1)", "SqMD (1)", concat("RMSE (", escaped(data.unit), ")"), "PSNR (dB)", "SSIM (1)"},
             {number(m.pearson, 4), number(m.sqmd, 4), number(m.rmse), number(m.psnr_db), number(m.ssim)}},
            "numbers");
  return section(
      "How well they agree", concat("Every horizontal slice and every voxel of ", data.field->label, "."),
      concat(numbers, "<div class=\"plots\">",
             figure(*height, "Agreement of horizontal slices against the height above the burner."),
             figure(*scatter,
                    "Every voxel: truth against reconstruction (logarithmic density, bright = many). A "
                    "perfect result lies on the dashed line."),
             "</div>"));
}

Result<std::string> residual_section(const ReportData& data) {
  if (!data.field) return std::string();
  const ReportField& field = *data.field;
  std::string plots;
  if (!field.residual_per_view.empty()) {
    Plot plot{.x_label = "camera", .y_label = "residual |Ax − b| / |b| (1)"};
    plot.x_names = field.view_names;
    Series bars{"", {}, field.residual_per_view, Mark::Bars, kBlue};
    for (std::size_t i = 0; i < field.residual_per_view.size(); ++i) bars.x.push_back(static_cast<double>(i));
    plot.x_range = {{-0.7, static_cast<double>(bars.x.size()) - 0.3}};
    const Statistics s = statistics(bars.y);
    plot.y_range = {{0, s.count > 0 && s.max > 0 ? 1.15 * s.max : 1}};
    plot.series = {bars};
    const auto svg = svg_of(plot, "views");
    if (!svg) return svg;
    plots +=
        figure(*svg, "What the volume leaves unexplained in each view. One tall bar: look at that camera.");
  }
  if (field.history.size() > 1) {
    Plot plot{.x_label = "iteration (count)", .y_label = "residual |Ax − b| / |b| (1)"};
    Series line{"", {}, {}, Mark::LinePoints, kBlue};
    for (const ReportField::Step& step : field.history) {
      line.x.push_back(step.iteration);
      line.y.push_back(step.residual > 0 ? step.residual : kUnknown);
    }
    plot.log_y = statistics(line.y).count > 0;
    plot.series = {line};
    const auto svg = svg_of(plot, "convergence");
    if (!svg) return svg;
    plots += figure(*svg, "Convergence of the solver.");
  }
  if (plots.empty()) return plots;
  return section(
      "Does the volume explain the images?",
      concat("Residuals of ", field.label, ": rendered again and compared with the prepared images."),
      concat("<div class=\"plots\">", plots, "</div>"));
}

}  // namespace flamefield
