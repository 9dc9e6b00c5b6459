// What became of every pulse, and how long it took.
#include <algorithm>
#include <cmath>

#include "services/report/html.h"
#include "services/report/plot.h"
#include "services/report/report_sections.h"

namespace flamefield {
namespace {

std::vector<double> numbers_of(const std::vector<ReportPulse>& pulses) {
  std::vector<double> out;
  for (const ReportPulse& p : pulses) out.push_back(static_cast<double>(p.pulse));
  return out;
}

// Share of the pulses that were at least as fast, in percent.
Series distribution(const std::string& name, std::vector<double> times_ms, const char* colour) {
  std::erase_if(times_ms, [](double v) { return !(v > 0) || !std::isfinite(v); });
  std::ranges::sort(times_ms);
  Series out{name, {}, {}, Mark::Line, colour};
  for (std::size_t i = 0; i < times_ms.size(); ++i) {
    const double before = 100.0 * static_cast<double>(i) / static_cast<double>(times_ms.size());
    const double after = 100.0 * static_cast<double>(i + 1) / static_cast<double>(times_ms.size());
    out.x.insert(out.x.end(), {times_ms[i], times_ms[i]});
    out.y.insert(out.y.end(), {before, after});
  }
  return out;
}

}  // namespace

Result<std::string> pulses_section(const ReportData& data) {
  const std::vector<double> pearson = column(data.per_pulse, &ReportPulse::pearson);
  const std::vector<double> sqmd = column(data.per_pulse, &ReportPulse::sqmd);
  const std::vector<double> residual = column(data.per_pulse, &ReportPulse::residual);
  const std::vector<double> pulse = numbers_of(data.per_pulse);
  std::string plots;
  if (statistics(pearson).count > 0) {
    Plot plot{.x_label = "pulse (number)", .y_label = "Pearson correlation (1)", .y2_label = "SqMD (1)"};
    plot.y2_range = {{0, std::max(1e-6, 1.2 * statistics(sqmd).max)}};
    plot.series = {{"Pearson", pulse, pearson, Mark::LinePoints, kBlue},
                   {"SqMD", pulse, sqmd, Mark::LinePoints, kOrange, true}};
    const auto svg = svg_of(plot, "pulses");
    if (!svg) return svg;
    plots += figure(*svg, "Agreement with the known flame, pulse by pulse.");
  }
  if (const Statistics s = statistics(residual); s.count > 0) {
    Plot plot{.x_label = "pulse (number)", .y_label = "residual |Ax − b| / |b| (1)"};
    plot.y_range = {{0, std::max(1e-6, 1.15 * s.max)}};
    plot.series = {{"", pulse, residual, Mark::LinePoints, kBlue}};
    const auto svg = svg_of(plot, "residuals");
    if (!svg) return svg;
    plots += figure(*svg, "What each volume leaves unexplained in its images.");
  }
  if (plots.empty()) return plots;
  return section("Every pulse",
                 "A drop marks a pulse to look at: a lost frame, a saturated view, an extinction.",
                 concat("<div class=\"plots\">", plots, "</div>"));
}

Result<std::string> latency_section(const ReportData& data) {
  const std::vector<double> set = column(data.per_pulse, &ReportPulse::pulse_to_set_ms);
  const std::vector<double> volume = column(data.per_pulse, &ReportPulse::set_to_volume_ms);
  const Statistics s = statistics(set), v = statistics(volume);
  if (s.count + v.count == 0) return std::string();
  Plot plot{.x_label = "time (ms)", .y_label = "share of pulses (%)"};
  plot.log_x = true;
  plot.y_range = {{0, 100}};
  plot.series = {distribution("pulse to frame set", set, kBlue),
                 distribution("frame set to volume", volume, kOrange)};
  if (std::isfinite(data.pulse_period_ms)) {
    plot.series.push_back(
        {"pulse period", {data.pulse_period_ms, data.pulse_period_ms}, {0, 100}, Mark::Dashed, kGrey});
  }
  const auto svg = svg_of(plot, "latency");
  if (!svg) return svg;
  const auto row = [](const std::string& name, const Statistics& t) {
    return std::vector<std::string>{name, concat(t.count), number(t.median), number(t.p99), number(t.max)};
  };
  const std::string numbers =
      table({{"Step", "Pulses (count)", "Median (ms)", "99th percentile (ms)", "Slowest (ms)"},
             row("pulse to frame set", s),
             row("frame set to volume", v)},
            "numbers");
  return section("Latency",
                 "From the trigger edge to an assembled frame set, and from there to the finished volume.",
                 concat("<div class=\"plots\">", figure(*svg, "Distribution of the times of all pulses."),
                        "</div>", numbers));
}

}  // namespace flamefield
