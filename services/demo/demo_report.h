#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calibrate/calibrate.h"
#include "proto/job.h"
#include "services/acquisition/operator.h"
#include "services/demo/demo.h"
#include "services/demo/evaluation.h"
#include "services/simulation/laboratory.h"

namespace flamefield {

// Everything that one demonstration found out.
struct DemoRecord {
  const DemoOptions& options;
  const Laboratory& laboratory;
  const CalibrationReport& calibration;
  const Processing& processing;
  const std::string& burst;
  const std::filesystem::path& data_dir;
  const std::vector<EvaluatedRun>& pulses;
  const std::vector<EvaluatedRun>& mean;
  const DemoSummary& summary;
};

// The report of a demonstration; raw images come from the dispatcher, prepared ones from the run's files.
Result<> write_demo_report(const std::filesystem::path& path, const DemoRecord& record,
                           Operator& at_the_burner);

}  // namespace flamefield
