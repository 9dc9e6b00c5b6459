#include "services/demo/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "services/store/file.h"

namespace flamefield {

double pulse_to_set_ms(const EvaluatedRun& run) {
  return static_cast<double>(run.set.complete_time_ns - run.set.pulse_time_ns) * 1e-6;
}

double set_to_volume_ms(const EvaluatedRun& run) {
  return static_cast<double>(run.run.committed_time_ns - run.set.complete_time_ns) * 1e-6;
}

void summarise_runs(const std::vector<EvaluatedRun>& pulses, const std::vector<EvaluatedRun>& mean,
                    DemoSummary& summary) {
  std::vector<double> to_set, to_volume;
  summary.pearson_mean = summary.sqmd_mean = 0;
  summary.pearson_worst = 1;
  for (const EvaluatedRun& run : pulses) {
    to_set.push_back(pulse_to_set_ms(run));
    to_volume.push_back(set_to_volume_ms(run));
    summary.pearson_mean += run.metrics.pearson / static_cast<double>(pulses.size());
    summary.sqmd_mean += run.metrics.sqmd / static_cast<double>(pulses.size());
    summary.pearson_worst = std::min(summary.pearson_worst, run.metrics.pearson);
  }
  summary.pulse_to_set_p99_ms = quantile(to_set, 0.99);
  summary.set_to_volume_p99_ms = quantile(to_volume, 0.99);
  if (!mean.empty()) {
    summary.pearson_of_mean = mean.front().metrics.pearson;
    summary.sqmd_of_mean = mean.front().metrics.sqmd;
  }
}

Result<> write_summary(const std::filesystem::path& path, const DemoSummary& s) {
  const nlohmann::ordered_json json = {
      {"pulses", s.pulses},
      {"sets", s.sets},
      {"volumes", s.volumes},
      {"calibration_rms_px", s.calibration_rms_px},
      {"volume_error_px", {{"mean", s.volume_error_mean_px}, {"worst", s.volume_error_worst_px}}},
      {"pearson_mean", s.pearson_mean},
      {"pearson_worst", s.pearson_worst},
      {"sqmd_mean", s.sqmd_mean},
      {"pearson_of_mean", s.pearson_of_mean},
      {"sqmd_of_mean", s.sqmd_of_mean},
      {"pulse_to_set_p99_ms", s.pulse_to_set_p99_ms},
      {"set_to_volume_p99_ms", s.set_to_volume_p99_ms},
      {"job_wall_s", s.job_wall_s}};
  return write_text_file(path, json.dump(2) + "\n");
}

std::string summary_table(const DemoSummary& s) {
  std::string out;
  const auto line = [&](const std::string& what, const std::string& value, const std::string& note) {
    out += fmt::format("  {:<38} {:>16}   {}\n", what, value, note);
  };
  line("pulses = sets = volumes", fmt::format("{} = {} = {}", s.pulses, s.sets, s.volumes),
       s.pulses == s.sets && s.sets == s.volumes ? "balanced" : "NOT BALANCED");
  line("calibration RMS", fmt::format("{:.3f} px", s.calibration_rms_px), "per corner point");
  line("volume error, mean of cameras", fmt::format("{:.3f} px", s.volume_error_mean_px),
       "against the known rig");
  line("volume error, worst camera", fmt::format("{:.3f} px", s.volume_error_worst_px),
       s.volume_error_worst_camera);
  line("Pearson, mean over pulses", fmt::format("{:.4f}", s.pearson_mean),
       fmt::format("against the known flame; worst {:.4f}", s.pearson_worst));
  line("SqMD, mean over pulses", fmt::format("{:.4f}", s.sqmd_mean), "squared Manhattan distance, Eq. 5");
  line("Pearson / SqMD of the mean flame", fmt::format("{:.4f} / {:.4f}", s.pearson_of_mean, s.sqmd_of_mean),
       "");
  line("pulse to set, p99", fmt::format("{:.1f} ms", s.pulse_to_set_p99_ms), "trigger edge to assembled set");
  line("set to volume, p99", fmt::format("{:.1f} s", s.set_to_volume_p99_ms * 1e-3), "to the committed run");
  line("job", fmt::format("{:.1f} s", s.job_wall_s), "wall time, everything above");
  return out;
}

}  // namespace flamefield
