#include "services/study/record.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "services/store/file.h"
#include "services/store/volume_file.h"

namespace flamefield {

namespace {

using nlohmann::json;

constexpr const char* kFormat = "flamefield-study-run-1";
constexpr std::uint64_t kMostBytes = 64u << 20;

// JSON has no NaN; null stands for it.
json number_or_null(double value) {
  return std::isfinite(value) ? json(value) : json();
}
double number_of(const json& value) {
  return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
}

json slices_json(const std::vector<SliceMetrics>& slices) {
  json list = json::array();
  for (const SliceMetrics& s : slices)
    list.push_back({s.index, number_or_null(s.pearson), number_or_null(s.sqmd)});
  return list;
}
std::vector<SliceMetrics> slices_of(const json& list) {
  std::vector<SliceMetrics> out;
  for (const json& row : list)
    out.push_back({row.at(0).get<int>(), number_of(row.at(1)), number_of(row.at(2))});
  return out;
}

RunRecord parse(const json& j) {
  RunRecord r;
  r.id = j.at("id");
  r.settings = j.at("settings").get<std::map<std::string, std::string>>();
  r.solver = j.at("solver"), r.phantom = j.at("phantom"), r.program = j.at("program");
  r.metrics.pearson = number_of(j.at("pearson")), r.metrics.sqmd = number_of(j.at("sqmd_3d"));
  r.metrics.rmse = number_of(j.at("rmse")), r.metrics.psnr_db = number_of(j.at("psnr_db"));
  r.metrics.ssim = number_of(j.at("ssim"));
  for (std::size_t axis = 0; axis < 3; ++axis)
    r.metrics.slices[axis] = slices_of(j.at("slices").at(std::string(1, "xyz"[axis])));
  r.sqmd_2d = number_of(j.at("sqmd_2d")), r.fitness = number_of(j.at("fitness"));
  r.residual = number_of(j.at("residual")), r.iterations = j.at("iterations"), r.wall_s = j.at("wall_s");
  r.stop_reason = j.at("stop_reason"), r.notes = j.at("notes").get<std::vector<std::string>>();
  for (const json& p : j.at("history"))
    r.history.push_back({p.at(0).get<int>(), number_of(p.at(1)), number_of(p.at(2)), number_of(p.at(3))});
  r.hab_first_mm = j.at("hab_first_mm"), r.hab_step_mm = j.at("hab_step_mm");
  return r;
}

}  // namespace

std::string json_of(const RunRecord& r) {
  json history = json::array();
  for (const HistoryPoint& p : r.history)
    history.push_back({p.iteration, number_or_null(p.residual), p.elapsed_s, number_or_null(p.fitness)});
  const json j = {{"format", kFormat},
                  {"id", r.id},
                  {"settings", r.settings},
                  {"solver", r.solver},
                  {"phantom", r.phantom},
                  {"program", r.program},
                  {"pearson", number_or_null(r.metrics.pearson)},
                  {"sqmd_3d", number_or_null(r.metrics.sqmd)},
                  {"rmse", number_or_null(r.metrics.rmse)},
                  {"psnr_db", number_or_null(r.metrics.psnr_db)},
                  {"ssim", number_or_null(r.metrics.ssim)},
                  {"sqmd_2d", number_or_null(r.sqmd_2d)},
                  {"fitness", number_or_null(r.fitness)},
                  {"residual", number_or_null(r.residual)},
                  {"iterations", r.iterations},
                  {"wall_s", r.wall_s},
                  {"stop_reason", r.stop_reason},
                  {"notes", r.notes},
                  {"slices",
                   {{"x", slices_json(r.metrics.slices[0])},
                    {"y", slices_json(r.metrics.slices[1])},
                    {"z", slices_json(r.metrics.slices[2])}}},
                  {"hab_first_mm", r.hab_first_mm},
                  {"hab_step_mm", r.hab_step_mm},
                  {"history", history}};
  return j.dump(1) + "\n";
}

Result<RunRecord> record_from_json(const std::string& text) {
  try {
    const json j = json::parse(text);
    if (j.at("format") == kFormat) return parse(j);
  } catch (const json::exception&) {  // falls through
  }
  return invalid_input("a record of a run", "it is damaged or of another program", "run the study again");
}

Result<RecordStore> RecordStore::open(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder / "runs", error);
  if (error)
    return invalid_input(concat("folder '", folder.string(), "'"),
                         concat("it cannot be made: ", error.message()), "choose another one with --out");
  if (auto ok = check_writable(folder / "runs" / "probe.json"); !ok) return tl::unexpected(ok.error());
  return RecordStore(folder / "runs");
}

std::optional<RunRecord> RecordStore::find(const std::string& id) const {
  const auto text = read_text_file(runs_ / (id + ".json"), kMostBytes);
  if (!text) return std::nullopt;
  auto record = record_from_json(*text);
  if (!record || record->id != id) return std::nullopt;
  return std::move(*record);
}

bool RecordStore::has_volume(const std::string& id) const {
  return std::filesystem::exists(runs_ / (id + ".vtkhdf"));
}

Result<> RecordStore::put(const RunRecord& record) const {
  return write_text_file(runs_ / (record.id + ".json"), json_of(record));
}

Result<> RecordStore::put_volume(const std::string& id, const Volume& volume) const {
  return write_volume(runs_ / (id + ".vtkhdf"), volume, {{"study_run", id}});
}

Result<Volume> RecordStore::volume(const std::string& id, const Grid& grid) const {
  auto volume = read_volume(runs_ / (id + ".vtkhdf"));
  if (volume && (volume->grid.nx != grid.nx || volume->grid.ny != grid.ny || volume->grid.nz != grid.nz))
    return invalid_input(concat("volume of run ", id), "it has another grid", "run the study with --again");
  return volume;
}

void RecordStore::remove(const std::string& id) const {
  std::error_code ignored;
  std::filesystem::remove(runs_ / (id + ".json"), ignored);
  std::filesystem::remove(runs_ / (id + ".vtkhdf"), ignored);
}

}  // namespace flamefield
