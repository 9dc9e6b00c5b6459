#pragma once

#include <string>

#include "services/report/report.h"

namespace flamefield {

// The sections of the report, in the order of reading. Each is empty when the data have nothing for it.
std::string headline_section(const ReportData& data);
std::string camera_images_section(const ReportData& data);
std::string film_section(const ReportData& data);
std::string slices_section(const ReportData& data);
Result<std::string> field_plots_section(const ReportData& data);
Result<std::string> residual_section(const ReportData& data);
Result<std::string> calibration_section(const ReportData& data);
Result<std::string> board_session_section(const ReportData& data);
Result<std::string> pulses_section(const ReportData& data);
Result<std::string> latency_section(const ReportData& data);
std::string receipt_section(const ReportData& data);
std::string repeat_section(const ReportData& data);

// Mean, standard deviation and quantiles of the values that are known.
struct Statistics {
  std::size_t count = 0;
  double mean = kUnknown, sd = kUnknown, median = kUnknown, p99 = kUnknown, max = kUnknown;
};
Statistics statistics(std::vector<double> values);
std::vector<double> column(const std::vector<ReportPulse>& pulses, double ReportPulse::*field);

}  // namespace flamefield
