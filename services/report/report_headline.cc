// What a reader wants to know in a minute, what the cameras saw, the receipt and how to repeat it all.
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <numeric>
#include <sstream>

#include "services/report/html.h"
#include "services/report/report_sections.h"

namespace flamefield {
namespace {

enum class Verdict { Good, Fair, Poor, None };

std::string chip(Verdict verdict) {
  switch (verdict) {
    case Verdict::Good:
      return "<span class=\"chip good\">✓ good</span>";
    case Verdict::Fair:
      return "<span class=\"chip fair\">~ fair</span>";
    case Verdict::Poor:
      return "<span class=\"chip poor\">✗ poor</span>";
    case Verdict::None:
      return "<span class=\"chip\">not judged</span>";
  }
  return "";
}

Verdict at_least(double value, double good, double fair) {
  if (!std::isfinite(value)) return Verdict::None;
  return value >= good ? Verdict::Good : value >= fair ? Verdict::Fair : Verdict::Poor;
}
Verdict at_most(double value, double good, double fair) {
  return at_least(-value, -good, -fair);
}

std::string strong(const std::string& words) {
  return concat("<strong>", words, "</strong>");
}

std::string with_sd(const Statistics& s) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(3) << s.mean;
  if (s.count > 1) out << " ± " << s.sd;
  return out.str();
}

void add_accuracy(const ReportData& data, std::vector<std::vector<std::string>>& rows) {
  Statistics pearson = statistics(column(data.per_pulse, &ReportPulse::pearson));
  Statistics sqmd = statistics(column(data.per_pulse, &ReportPulse::sqmd));
  if (pearson.count == 0 && data.field && data.field->metrics) {
    pearson = statistics({data.field->metrics->pearson}), sqmd = statistics({data.field->metrics->sqmd});
  }
  if (pearson.count == 0) return;
  rows.push_back({"Pearson correlation with the known flame", strong(with_sd(pearson)), "1",
                  chip(at_least(pearson.mean, 0.93, 0.85)),
                  concat("mean ± standard deviation over ", pearson.count, " volumes; 1 is perfect")});
  rows.push_back({"Normalised distance SqMD", strong(with_sd(sqmd)), "1", chip(at_most(sqmd.mean, 0.15, 0.4)),
                  "squared Manhattan distance over that of the truth; 0 is perfect"});
}

void add_calibration(const ReportData& data, std::vector<std::vector<std::string>>& rows) {
  if (!data.calibration) return;
  const ReportCalibration& c = *data.calibration;
  if (c.rig.quality) {
    rows.push_back({"Calibration residual (RMS)", strong(number(c.rig.quality->rms_px)), "px",
                    chip(at_most(c.rig.quality->rms_px, 0.3, 1)),
                    concat("per corner, ", c.rig.cameras.size(), " cameras, ", c.rig.quality->board_poses,
                           " board poses")});
  }
  if (std::isfinite(c.volume_error_mean_px)) {
    rows.push_back(
        {"Error in the measuring volume", strong(number(c.volume_error_mean_px)), "px",
         chip(at_most(c.volume_error_mean_px, 0.1, 0.3)),
         concat(
             "mean over cameras against the true rig; worst ", number(c.volume_error_worst_px), " px",
             c.volume_error_worst_camera.empty() ? "" : " (" + escaped(c.volume_error_worst_camera) + ")")});
  }
  if (std::isfinite(c.expected_error_mean_px)) {
    rows.push_back(
        {"Expected error in the measuring volume", strong(number(c.expected_error_mean_px)), "px",
         chip(at_most(c.expected_error_worst_px, 0.2, 0.5)),
         concat("mean over cameras, from the covariance of the adjustment; worst ",
                number(c.expected_error_worst_px), " px (", escaped(c.expected_error_worst_camera), ")")});
  }
}

void add_times(const ReportData& data, std::vector<std::vector<std::string>>& rows) {
  const Statistics set = statistics(column(data.per_pulse, &ReportPulse::pulse_to_set_ms));
  const Statistics volume = statistics(column(data.per_pulse, &ReportPulse::set_to_volume_ms));
  if (set.count > 0) {
    rows.push_back(
        {"Pulse to frame set, 99th percentile", strong(number(set.p99)), "ms",
         chip(std::isfinite(data.pulse_period_ms)
                  ? at_most(set.p99, data.pulse_period_ms, 2 * data.pulse_period_ms)
                  : Verdict::None),
         concat("median ", number(set.median), " ms; good: within one pulse period",
                std::isfinite(data.pulse_period_ms) ? concat(" of ", number(data.pulse_period_ms), " ms")
                                                    : "")});
  }
  if (volume.count > 0) {
    rows.push_back({"Frame set to volume, 99th percentile", strong(number(volume.p99)), "ms",
                    chip(Verdict::None), concat("median ", number(volume.median), " ms, queueing included")});
  }
  if (std::isfinite(data.job_wall_s)) {
    rows.push_back({"Wall time of the whole job", strong(number(data.job_wall_s)), "s", chip(Verdict::None),
                    "from arming the cameras to this report"});
  }
}

RgbImage grey(const Image& image, double full_scale) {
  RgbImage out(image.width_px, image.height_px);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const double v = std::clamp(static_cast<double>(image.pixels[i]) / full_scale, 0.0, 1.0);
    std::fill_n(out.bytes.begin() + static_cast<std::ptrdiff_t>(3 * i), 3,
                static_cast<std::uint8_t>(std::lround(255 * v)));
  }
  return out;
}

Image fitted(const Image& image, int width_px) {
  if (image.width_px <= width_px) return image;
  return resized(image, width_px,
                 std::max(1, static_cast<int>(std::lround(static_cast<double>(image.height_px) * width_px /
                                                          image.width_px))));
}

}  // namespace

Statistics statistics(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  Statistics out;
  out.count = values.size();
  if (values.empty()) return out;
  std::ranges::sort(values);
  const auto n = static_cast<double>(values.size());
  out.mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  double squares = 0;
  for (double v : values) squares += (v - out.mean) * (v - out.mean);
  out.sd = values.size() > 1 ? std::sqrt(squares / (n - 1)) : 0;
  // Nearest rank: the smallest value that so many of all values do not exceed.
  const auto rank = [&](double q) { return values[static_cast<std::size_t>(std::ceil(q * n)) - 1]; };
  out.median = rank(0.5), out.p99 = rank(0.99), out.max = values.back();
  return out;
}

std::vector<double> column(const std::vector<ReportPulse>& pulses, double ReportPulse::*field) {
  std::vector<double> out;
  for (const ReportPulse& p : pulses) out.push_back(p.*field);
  return out;
}

std::string headline_section(const ReportData& data) {
  std::vector<std::vector<std::string>> rows = {{"Quantity", "Value", "Unit", "Verdict", "How to read it"}};
  if (data.pulses > 0) {
    const bool complete = data.pulses == data.sets && data.sets == data.volumes;
    rows.push_back({"Pulses = frame sets = volumes",
                    strong(concat(data.pulses, complete ? " = " : " → ", data.sets, complete ? " = " : " → ",
                                  data.volumes)),
                    "count", chip(complete ? Verdict::Good : Verdict::Poor),
                    complete ? "nothing was lost on the way" : "see the receipt for what was lost, and why"});
  }
  add_accuracy(data, rows);
  add_calibration(data, rows);
  add_times(data, rows);
  if (rows.size() == 1) return "";
  return section("At a glance", "The numbers that say whether this measurement can be used.",
                 table(rows, "headline"));
}

std::string camera_images_section(const ReportData& data) {
  if (data.images.empty()) return "";
  double brightest = 1, projected = 0;
  for (const ReportImages& i : data.images) {
    brightest = std::max(brightest, emission_range(i.raw.pixels).high);
    if (!i.prepared.pixels.empty()) projected = std::max(projected, emission_range(i.prepared.pixels).high);
  }
  const auto raw = [&](const ReportImages& i, int width_px) {
    return i.raw.pixels.empty()
               ? std::string()
               : inline_image(grey(fitted(i.raw, width_px), i.full_scale > 0 ? i.full_scale : brightest),
                              "raw image of " + i.camera);
  };
  const auto prepared = [&](const ReportImages& i) {
    return i.prepared.pixels.empty() ? std::string()
                                     : inline_image(coloured(i.prepared, inferno(), {0, projected}),
                                                    "prepared image of " + i.camera, "class=\"pixels\"");
  };
  const ReportImages& first = data.images.front();
  std::string content =
      concat("<div class=\"pair\">",
             figure(raw(first, 659), concat(first.camera, ", raw: ", first.raw.width_px, " × ",
                                            first.raw.height_px, " px, grey levels 0 to ",
                                            number(first.full_scale > 0 ? first.full_scale : brightest, 3))));
  if (!first.prepared.pixels.empty()) {
    content += figure(prepared(first), concat(first.camera, ", prepared: ", first.prepared.width_px, " × ",
                                              first.prepared.height_px, " px, line integrals 0 to ",
                                              number(projected), " ", data.unit, "·mm"));
  }
  content += "</div>\n";
  if (!data.preparation.empty()) {
    content += "<details><summary>How raw became prepared</summary><ol>";
    for (const std::string& step : data.preparation) content += concat("<li>", escaped(step), "</li>");
    content += "</ol></details>\n";
  }
  content += "<div class=\"sheet\">";
  for (const ReportImages& i : data.images) {
    content += figure(raw(i, 180) + prepared(i), i.camera);
  }
  return section("What the cameras saw",
                 "One instant from every camera: as the sensor gave it (grey), and as the reconstruction "
                 "uses it (colour).",
                 content + "</div>\n");
}

std::string receipt_section(const ReportData& data) {
  if (data.receipts.empty()) return "";
  std::vector<std::string> causes;
  for (const ReportReceipt& r : data.receipts) {
    for (const auto& [cause, count] : r.losses) {
      if (std::ranges::find(causes, cause) == causes.end()) causes.push_back(cause);
    }
  }
  std::vector<std::vector<std::string>> rows = {{"Camera", "Pulses seen (count)", "Frames stored (count)"}};
  for (const std::string& cause : causes) rows[0].push_back(concat("Lost: ", escaped(cause), " (count)"));
  rows[0].push_back("Balance");
  for (const ReportReceipt& r : data.receipts) {
    std::int64_t accounted = r.stored;
    std::vector<std::string> row = {escaped(r.camera), concat(r.pulses), concat(r.stored)};
    for (const std::string& cause : causes) {
      const auto found = r.losses.find(cause);
      const std::int64_t lost = found == r.losses.end() ? 0 : found->second;
      accounted += lost;
      row.push_back(concat(lost));
    }
    const std::int64_t missing = r.pulses - accounted;
    row.push_back(missing == 0 ? "<span class=\"chip good\">✓ adds up</span>"
                               : concat("<span class=\"chip poor\">✗ ", missing, " unaccounted</span>"));
    rows.push_back(std::move(row));
  }
  return section("Receipt", "Per camera, pulses seen = frames stored + losses with a name.",
                 table(rows, "numbers"));
}

std::string repeat_section(const ReportData& data) {
  if (data.parameters.empty() && data.commands.empty()) return "";
  std::string content;
  if (!data.parameters.empty()) {
    std::vector<std::vector<std::string>> rows = {{"Parameter", "Value"}};
    for (const auto& [name, value] : data.parameters) {
      rows.push_back({escaped(name), concat("<code>", escaped(value), "</code>")});
    }
    content += table(rows);
  }
  if (!data.commands.empty()) {
    content += "<pre>";
    for (const std::string& command : data.commands) content += escaped(command) + "\n";
    content += "</pre>\n";
  }
  return section("How to repeat this",
                 "Versions, parameters and the commands that give the same result again.", content);
}

}  // namespace flamefield
