#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "services/demo/demo.h"
#include "services/demo/evaluation.h"

namespace flamefield {

// Adds what the evaluated runs say: correlations, distances and latencies.
void summarise_runs(const std::vector<EvaluatedRun>& pulses, const std::vector<EvaluatedRun>& mean,
                    DemoSummary& summary);

// Milliseconds from the trigger pulse to the assembled set, and from there to the committed volume.
double pulse_to_set_ms(const EvaluatedRun& run);
double set_to_volume_ms(const EvaluatedRun& run);

Result<> write_summary(const std::filesystem::path& path, const DemoSummary& summary);

// The same as a table for the terminal, one line a quantity, with what was asked for.
std::string summary_table(const DemoSummary& summary);

}  // namespace flamefield
