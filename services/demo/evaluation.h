#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "proto/volume.h"
#include "reconstruct/metrics.h"
#include "services/ledger/reader.h"

namespace flamefield {

// One run against the field that the simulated cameras looked at.
struct EvaluatedRun {
  RunRow run;
  SetRow set;  // its (first) input
  Volume volume;
  FieldMetrics metrics;
};

// The runs of a capture whose input is a single set, in order; `truth_of` gives the known field of set
// `index`.
Result<std::vector<EvaluatedRun>> evaluate_runs(const std::filesystem::path& data_dir,
                                                const std::string& capture, std::int64_t inputs,
                                                const std::function<Volume(std::int64_t index)>& truth_of);

// The value below which a share of the values lies (nearest rank); NaN when there are none.
double quantile(std::vector<double> values, double share);

}  // namespace flamefield
