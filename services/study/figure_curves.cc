// Curves over generations and over a parameter, and the scatter of repeated runs.
#include <algorithm>
#include <cmath>

#include "services/report/html.h"
#include "services/study/evolution.h"
#include "services/study/figures.h"

namespace flamefield {

namespace {

std::string repeats_text(const std::vector<RunGroup>& groups) {
  std::size_t most = 0;
  for (const RunGroup& g : groups) most = std::max(most, g.runs.size());
  return most > 1 ? concat("Mean of ", most, " runs.") : "";
}

// One plot with an axis on either side: means as a line, single runs as open points.
Result<std::string> errors_plot(const std::vector<RunGroup>& groups, const std::string& over,
                                std::string_view left, std::string_view right, const std::string& name) {
  Plot plot{.x_label = spoken(over) + (spoken(over).ends_with(")") ? "" : " (1)"),
            .y_label = std::string(symbol_of(left)),
            .y2_label = std::string(symbol_of(right))};
  std::size_t index = 0;
  double low_x = INFINITY, high_x = -INFINITY;
  for (std::string_view measured : {left, right}) {
    Series mean{std::string(measured == left ? left : right), {}, {}, Mark::LinePoints};
    mean.name = std::string(symbol_of(measured).substr(0, symbol_of(measured).find(" (1)")));
    Series single{"", {}, {}, Mark::OpenPoints};
    for (const RunGroup& group : groups) {
      const double x = number_of(group.value).value_or(NAN);
      low_x = std::min(low_x, x), high_x = std::max(high_x, x);
      std::vector<double> values;
      for (const FinishedRun* run : group.runs) values.push_back(measure(run->record, measured));
      mean.x.push_back(x), mean.y.push_back(spread_of(values).mean);
      if (values.size() > 1)
        for (double v : values) single.x.push_back(x), single.y.push_back(v);
    }
    mean.second_axis = single.second_axis = measured == right;
    style(mean, index), style(single, index++);
    plot.series.push_back(mean);
    if (!single.x.empty()) plot.series.push_back(single);
  }
  const double margin = 0.04 * std::max(1e-9, high_x - low_x);
  plot.x_range = {{low_x - margin, high_x + margin}};
  return svg_of(plot, name);
}

}  // namespace

Result<std::string> paths_figure(const StudyFigure& figure, const FigureSource& source) {
  Plot plot{.x_label = "generation (count)", .y_label = "fitness of the best 1 − Z (1)"};
  const std::vector<RunGroup> groups = groups_of(all_of(source.results), figure.over);
  for (const RunGroup& group : groups) {
    const FitnessPath path = mean_path(group.runs);
    if (path.generation.size() < 2) continue;
    const std::string name = figure.over == "case" || !number_of(group.value)
                                 ? group.name
                                 : concat(spoken(figure.over), " ", group.name);
    Series line{name, path.generation, path.fitness, Mark::Line};
    style(line, plot.series.size());
    plot.series.push_back(line);
  }
  if (plot.series.empty()) return std::string();
  double low = 1, high = 0;
  for (const Series& line : plot.series)
    for (std::size_t i = line.x.size() / 20; i < line.y.size(); ++i)
      low = std::min(low, line.y[i]), high = std::max(high, line.y[i]);
  plot.y_range = {{low - 0.05 * (high - low), high + 0.05 * (high - low) + 1e-9}};
  const auto svg = svg_of(plot, source.name);
  if (!svg) return svg;
  return ::flamefield::figure(*svg, caption_of(figure, repeats_text(groups)));
}

Result<std::string> errors_figure(const StudyFigure& figure, const FigureSource& source) {
  const std::vector<RunGroup> groups = groups_of(all_of(source.results), figure.over);
  const bool numeric = groups.size() > 1 && std::ranges::all_of(groups, [](const RunGroup& g) {
                         return number_of(g.value).has_value();
                       });
  if (!numeric) return std::string();
  const auto distances = errors_plot(groups, figure.over, "sqmd_2d", "sqmd_3d", source.name + "d");
  if (!distances) return distances;
  const auto quality = errors_plot(groups, figure.over, "fitness", "pearson", source.name + "q");
  if (!quality) return quality;
  const std::string more = repeats_text(groups).empty() ? "" : "Lines: means; open points: single runs.";
  return ::flamefield::figure(*distances, caption_of(figure, more)) +
         ::flamefield::figure(*quality, "Final fitness and correlation of the same runs.");
}

Result<std::string> stability_figure(const StudyFigure& figure, const FigureSource& source) {
  std::string out;
  for (const RunGroup& group :
       groups_of(all_of(source.results), figure.over.empty() ? "phantom.kind" : figure.over)) {
    if (group.runs.size() < 2) continue;
    Plot plot{.x_label = "run (count)",
              .y_label = std::string(symbol_of("pearson")),
              .y2_label = std::string(symbol_of("sqmd_3d"))};
    Series pearson{"Pearson", {}, {}, Mark::Points}, sqmd{"SqMD", {}, {}, Mark::OpenPoints};
    for (const FinishedRun* run : group.runs) {
      const auto x = static_cast<double>(pearson.x.size() + 1);
      pearson.x.push_back(x), pearson.y.push_back(run->record.metrics.pearson);
      sqmd.x.push_back(x), sqmd.y.push_back(run->record.metrics.sqmd);
    }
    const auto range_of = [](const Spread& s) -> std::optional<std::array<double, 2>> {
      if (s.count < 2) return std::nullopt;  // fields that are constant correlate with nothing
      const double reach = std::max({4 * s.sd, 1e-3 * std::abs(s.mean), 1e-6});
      return {{s.mean - reach, s.mean + reach}};
    };
    const Spread p = spread_of(pearson.y), q = spread_of(sqmd.y);
    const double last = pearson.x.back();
    Series mean{"mean", {0.5, last + 0.5}, {p.mean, p.mean}, Mark::Dashed, kBlue};
    sqmd.second_axis = true;
    sqmd.colour = kOrange;
    plot.x_range = {{0.5, last + 0.5}};
    plot.y_range = range_of(p), plot.y2_range = range_of(q);
    plot.series = {pearson, sqmd, mean};
    const auto svg = svg_of(plot, concat(source.name, out.size()));
    if (!svg) return svg;
    out += ::flamefield::figure(
        *svg, caption_of(figure, concat(group.name, ", ", group.runs.size(), " seeds: Pearson ",
                                        text_of(p, 4), ", SqMD ", text_of(q, 4), ".")));
  }
  return out;
}

}  // namespace flamefield
