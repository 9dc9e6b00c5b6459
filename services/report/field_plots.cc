#include "services/report/field_plots.h"

#include <algorithm>
#include <cmath>

#include "services/report/report_sections.h"

namespace flamefield {
namespace {

constexpr int kBins = 60;  // of the scatter plot, per axis

}  // namespace

Volume difference(const Volume& a, const Volume& b) {
  Volume out(a.grid);
  std::ranges::transform(a.values, b.values, out.values.begin(), std::minus{});
  return out;
}

Plot scatter_plot(const Volume& truth, const Volume& volume, const std::string& unit) {
  const double high = std::max(emission_range(truth.values).high, emission_range(volume.values).high);
  std::vector<double> counts(kBins * kBins);
  const auto bin = [&](float v) {
    return std::clamp(static_cast<int>(static_cast<double>(v) / high * kBins), 0, kBins - 1);
  };
  for (std::size_t i = 0; i < truth.values.size(); ++i) {
    counts[static_cast<std::size_t>(bin(volume.values[i]) * kBins + bin(truth.values[i]))] += 1;
  }
  Plot plot{.x_label = concat("true emission (", unit, ")"),
            .y_label = concat("reconstructed emission (", unit, ")")};
  Cells cells;
  cells.width = cells.height = high / kBins;
  for (int y = 0; y < kBins; ++y) {
    for (int x = 0; x < kBins; ++x) {
      const double count = counts[static_cast<std::size_t>(y * kBins + x)];
      if (count == 0) continue;
      cells.x.push_back((x + 0.5) * cells.width);
      cells.y.push_back((y + 0.5) * cells.height);
      cells.value.push_back(std::log10(count));
    }
  }
  cells.range = {-0.8, *std::ranges::max_element(cells.value) + 0.3};
  plot.cells = std::move(cells);
  plot.series.push_back({"identity", {0, high}, {0, high}, Mark::Dashed, kBlue});
  plot.x_range = plot.y_range = {{0, high}};
  plot.equal_axes = true;
  plot.height_px = 460;
  return plot;
}

Plot height_plot(const Grid& grid, const FieldMetrics& metrics) {
  Series pearson{"Pearson", {}, {}, Mark::LinePoints, kBlue}, sqmd{"SqMD", {}, {}, Mark::LinePoints, kOrange};
  for (const SliceMetrics& m : metrics.slices[1]) {
    const double hab_mm = grid.voxel_centre_mm(0, m.index, 0).y();
    pearson.x.push_back(hab_mm), pearson.y.push_back(m.pearson);
    sqmd.x.push_back(hab_mm), sqmd.y.push_back(m.sqmd);
  }
  sqmd.second_axis = true;
  Plot plot{.x_label = "height above burner HAB y (mm)",
            .y_label = "Pearson correlation (1)",
            .y2_label = "SqMD (1)"};
  plot.x_range = {{grid.lower_mm().y(), grid.upper_mm().y()}};
  const Statistics s = statistics(sqmd.y);
  plot.y2_range = {{0, s.count > 0 && s.max > 0 ? 1.1 * s.max : 1}};
  plot.series = {pearson, sqmd};
  return plot;
}

}  // namespace flamefield
