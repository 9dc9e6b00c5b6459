#include "services/demo/evaluation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "services/store/volume_file.h"

namespace flamefield {

Result<std::vector<EvaluatedRun>> evaluate_runs(const std::filesystem::path& data_dir,
                                                const std::string& capture, std::int64_t inputs,
                                                const std::function<Volume(std::int64_t)>& truth_of) {
  auto reader = LedgerReader::open(data_dir);
  if (!reader) return tl::unexpected(reader.error());
  const auto sets = reader->sets(capture);
  if (!sets) return tl::unexpected(sets.error());
  std::map<SetId, SetRow> set_of;
  for (const SetRow& set : *sets) set_of[set.id] = set;
  const auto runs = reader->runs({.capture = capture, .inputs = inputs});
  if (!runs) return tl::unexpected(runs.error());

  std::vector<EvaluatedRun> out;
  for (const RunRow& row : *runs) {
    auto volume = read_volume(data_dir / row.run.volume_path);
    if (!volume) return tl::unexpected(volume.error());
    const SetId first = row.run.inputs.front();
    auto metrics = compare(truth_of(first.index), *volume);
    if (!metrics) return tl::unexpected(metrics.error());
    out.push_back({row, set_of[first], std::move(*volume), std::move(*metrics)});
  }
  return out;
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto n = static_cast<double>(values.size());
  const auto rank = static_cast<std::ptrdiff_t>(std::clamp(std::ceil(share * n), 1.0, n)) - 1;
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

}  // namespace flamefield
