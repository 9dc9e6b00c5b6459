// Figures of the fields themselves: slices side by side, correlation against height, scatter plots.
#include <algorithm>
#include <cmath>

#include "services/report/field_plots.h"
#include "services/report/html.h"
#include "services/report/slice_figure.h"
#include "services/study/figures.h"

namespace flamefield {

namespace {

constexpr const char* kUnit = "a.u.";

// Methods that saw the same images: the first repeat of each case.
struct SameScene {
  std::string phantom;
  std::shared_ptr<const StudyScene> scene;
  std::vector<std::string> names;
  std::vector<Volume> volumes;
  std::vector<const FinishedRun*> runs;
};

std::string method_of(const StudyRun& run) {
  return run.case_name.empty() ? run.settings.recipe.solver : run.case_name;
}

Result<std::vector<SameScene>> same_scenes(const FigureSource& source) {
  std::vector<SameScene> out;
  std::vector<std::string> known;
  for (const FinishedRun& run : source.results.runs) {
    if (run.run.repeat > 0 || !source.store.has_volume(run.run.id)) continue;
    const std::string scene_id = run.run.settings.scene_id();
    auto at = std::ranges::find(known, scene_id) - known.begin();
    if (at == static_cast<std::ptrdiff_t>(known.size())) {
      auto scene = source.scenes.get(run.run.settings, 0);
      if (!scene) return tl::unexpected(scene.error());
      known.push_back(scene_id);
      out.push_back({phantom_name(run.run.settings), *scene, {}, {}, {}});
    }
    SameScene& group = out[static_cast<std::size_t>(at)];
    auto volume = source.store.volume(run.run.id, run.run.settings.grid());
    if (!volume) return tl::unexpected(volume.error());
    group.names.push_back(method_of(run.run));
    group.volumes.push_back(std::move(*volume));
    group.runs.push_back(&run);
  }
  return out;
}

struct Cut {
  Axis axis;
  int index;
};
std::vector<Cut> cuts(const Grid& g) {
  std::vector<Cut> out = {{Axis::X, central_layer(g, Axis::X)}, {Axis::Z, central_layer(g, Axis::Z)}};
  for (int fifth = 1; fifth <= 4; ++fifth) out.push_back({Axis::Y, g.ny * fifth / 5});
  return out;
}

std::string slice_row(const Volume& volume, const std::string& name, ValueRange range, bool first,
                      bool last) {
  const Grid& g = volume.grid;
  const Eigen::Vector3d size_mm = g.upper_mm() - g.lower_mm();
  const double px_per_mm = std::min(122 / std::max(size_mm.x(), size_mm.z()), 176 / size_mm.y());
  std::string row = concat("<tr><th scope=\"row\">", escaped(name), "</th>");
  Axis before = Axis::Y;
  bool has_level_before = false;
  for (const Cut& cut : cuts(g)) {
    // Slices in a row share their upward axis: the height, and then z.
    const bool label_up = cut.axis == Axis::Y ? !has_level_before : before == Axis::Y;
    has_level_before = has_level_before || cut.axis == Axis::Y;
    before = cut.axis;
    Slice s = slice(volume, cut.axis, cut.index);
    const double bottom = g.lower_mm().y();  // heights count from the bottom of the domain
    if (s.normal == Axis::Y)
      s.position_mm -= bottom;
    else
      s.up_mm = {s.up_mm[0] - bottom, s.up_mm[1] - bottom};
    SliceFigureOptions options{px_per_mm, last, label_up, ""};
    if (first) options.title = concat(label_of(cut.axis), " = ", number(s.position_mm, 2), " mm");
    row += concat("<td>", slice_svg(s, inferno(), range, options), "</td>");
  }
  return row + "</tr>\n";
}

std::string numbers_row(const FieldMetrics& m, const Grid& grid) {
  std::string row = "<tr class=\"between\"><th scope=\"row\">Pearson / SqMD</th>";
  for (const Cut& cut : cuts(grid)) {
    const auto& list = m.slices[static_cast<std::size_t>(cut.axis)];
    const auto found = std::ranges::find(list, cut.index, &SliceMetrics::index);
    row += found == list.end()
               ? "<td>–</td>"
               : concat("<td>", number(found->pearson, 3), " / ", number(found->sqmd, 3), "</td>");
  }
  return row + "</tr>\n";
}

}  // namespace

Result<std::string> slices_figure(const StudyFigure& figure, const FigureSource& source) {
  const auto groups = same_scenes(source);
  if (!groups) return tl::unexpected(groups.error());
  std::string out;
  for (const SameScene& c : *groups) {
    const ValueRange range = emission_range(c.scene->truth.values);
    std::string table = "<div class=\"scroll\"><table class=\"slices\"><tbody>\n" +
                        slice_row(c.scene->truth, "phantom", range, true, false);
    std::string whole;
    for (std::size_t i = 0; i < c.runs.size(); ++i) {
      const FieldMetrics& m = c.runs[i]->record.metrics;
      table += numbers_row(m, c.volumes[i].grid) +
               slice_row(c.volumes[i], c.names[i], range, false, i + 1 == c.runs.size());
      whole += concat(whole.empty() ? "" : "; ", c.names[i], ": Pearson ", number(m.pearson, 4), ", SqMD ",
                      number(m.sqmd, 4));
    }
    table += concat("</tbody></table></div><div class=\"bars\">",
                    colour_bar_svg(inferno(), range, concat("emission (", kUnit, ")")), "</div>");
    const std::string caption =
        caption_of(figure, concat(c.phantom,
                                  ". Slices normal to each axis and at heights above the burner; over "
                                  "each slice its correlation with and normalised Manhattan distance to "
                                  "that of the phantom. In 3D: ",
                                  whole, "."));
    out += ::flamefield::figure(table, caption, "wide");
  }
  return out;
}

Result<std::string> height_figure(const StudyFigure& figure, const FigureSource& source) {
  const auto groups = same_scenes(source);
  if (!groups) return tl::unexpected(groups.error());
  std::string out;
  for (const SameScene& c : *groups) {
    const Grid& g = c.scene->truth.grid;
    Plot plot{.x_label = "height above burner HAB y (mm)", .y_label = "Pearson correlation (1)"};
    plot.x_range = {{0, g.upper_mm().y() - g.lower_mm().y()}};
    const auto add = [&](const std::string& name, const std::vector<SliceMetrics>& slices) {
      Series line{name, {}, {}, Mark::Line};
      for (const SliceMetrics& m : slices) {
        line.x.push_back((m.index + 0.5) * g.spacing_mm.y());
        line.y.push_back(m.pearson);
      }
      style(line, plot.series.size());
      plot.series.push_back(line);
    };
    for (std::size_t i = 0; i < c.runs.size(); ++i)
      add(c.names[i] + " – phantom", c.runs[i]->record.metrics.slices[1]);
    if (c.volumes.size() >= 2)
      if (const auto between = compare(c.volumes[0], c.volumes[1]); between)
        add(concat(c.names[0], " – ", c.names[1]), between->slices[1]);
    const auto svg = svg_of(plot, concat(source.name, out.size()));
    if (!svg) return svg;
    out += ::flamefield::figure(*svg, caption_of(figure, concat(c.phantom, ".")));
  }
  return out;
}

Result<std::string> scatter_figure(const StudyFigure& figure, const FigureSource& source) {
  const auto groups = same_scenes(source);
  if (!groups) return tl::unexpected(groups.error());
  std::string out;
  for (const SameScene& c : *groups)
    for (std::size_t i = 0; i < c.runs.size(); ++i) {
      Plot plot = scatter_plot(c.scene->truth, c.volumes[i], kUnit);
      plot.width_px = 460, plot.height_px = 430;
      const auto svg = svg_of(plot, concat(source.name, out.size()));
      if (!svg) return svg;
      out += ::flamefield::figure(*svg, caption_of(figure, concat(c.phantom, ", ", c.names[i],
                                                                  ": every voxel, logarithmic density.")));
    }
  return out;
}

}  // namespace flamefield
