#pragma once

#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "reconstruct/metrics.h"
#include "reconstruct/solver.h"

namespace flamefield {

// What is known of a finished run. One small file each, which appears complete or not at all: what is there
// was done, what is not there has to be done, whatever happened to the program.
struct RunRecord {
  std::string id;
  std::map<std::string, std::string> settings;  // for people
  std::string solver, phantom, program;
  FieldMetrics metrics;
  double sqmd_2d = std::numeric_limits<double>::quiet_NaN();  // mean over views
  double fitness = 0;                                         // 1 - Z of the final volume (Eq. 3)
  double residual = 0;                                        // |Ax - b| / |b|
  int iterations = 0;
  double wall_s = 0;
  std::string stop_reason;
  std::vector<std::string> notes;
  std::vector<HistoryPoint> history;
  double hab_first_mm = 0, hab_step_mm = 1;  // height of the horizontal slices
};

std::string json_of(const RunRecord& record);
// InvalidInput for anything that json_of did not write.
Result<RunRecord> record_from_json(const std::string& text);

// The records of a study's folder: DIR/runs/ID.json, and ID.vtkhdf where volumes are kept.
class RecordStore {
 public:
  // Makes the folder. InvalidInput when it cannot be written.
  static Result<RecordStore> open(const std::filesystem::path& folder);

  // None when there is no such record, or when it is damaged and has to be made again.
  std::optional<RunRecord> find(const std::string& id) const;
  bool has_volume(const std::string& id) const;
  Result<> put(const RunRecord& record) const;
  Result<> put_volume(const std::string& id, const Volume& volume) const;
  Result<Volume> volume(const std::string& id, const Grid& grid) const;
  void remove(const std::string& id) const;

 private:
  explicit RecordStore(std::filesystem::path runs) : runs_(std::move(runs)) {}
  std::filesystem::path runs_;
};

}  // namespace flamefield
