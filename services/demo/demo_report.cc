#include "services/demo/demo_report.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <ctime>

#include "proto/recipe.h"
#include "proto/version.h"
#include "services/demo/summary.h"
#include "services/report/calibration_data.h"
#include "services/report/report.h"
#include "services/store/projection_file.h"

namespace flamefield {

namespace {

std::string utc_now() {
  return fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(std::time(nullptr)));
}

Image image_of_view(const Projections& projections, std::size_t view) {
  Image image(projections.cols, projections.rows);
  const auto values = projections.view(view);
  image.pixels.assign(values.begin(), values.end());
  return image;
}

// Raw and prepared pictures of the pulse that the figures show.
Result<std::vector<ReportImages>> images_of(const EvaluatedRun& shown, const DemoRecord& record,
                                            Operator& burner) {
  auto set = burner.dispatcher().ask_for<SetData>(FetchSet{shown.set.id}, std::chrono::seconds(10));
  if (!set) return tl::unexpected(set.error());
  const auto prepared = read_projections(record.data_dir / shown.run.run.projections_path);
  if (!prepared) return tl::unexpected(prepared.error());
  std::vector<ReportImages> out;
  for (const Frame& frame : set->set.frames) {
    auto raw = grey_levels(frame);
    if (!raw) return tl::unexpected(raw.error());
    ReportImages images{
        frame.camera, std::move(*raw), static_cast<double>((1 << bits_of(frame.format)) - 1), {}};
    for (std::size_t v = 0; v < prepared->views(); ++v) {
      if (prepared->view_names[v] == frame.camera) images.prepared = image_of_view(*prepared, v);
    }
    out.push_back(std::move(images));
  }
  return out;
}

ReportField field_of(const EvaluatedRun& shown, const DemoRecord& record) {
  ReportField field;
  field.label = fmt::format("pulse {}", shown.set.pulse);
  field.volume = shown.volume;
  field.truth = record.laboratory.film().truth(static_cast<int>(shown.set.id.index));
  field.metrics = shown.metrics;
  for (const auto& [camera, residual] : shown.run.run.residual_per_view) {
    field.view_names.push_back(camera);
    field.residual_per_view.push_back(residual);
  }
  return field;
}

ReportCalibration calibration_of(const DemoRecord& record) {
  ReportCalibration out = report_calibration(record.calibration);
  out.true_rig = record.laboratory.true_rig();
  out.volume_error_mean_px = record.summary.volume_error_mean_px;
  out.volume_error_worst_px = record.summary.volume_error_worst_px;
  out.volume_error_worst_camera = record.summary.volume_error_worst_camera;
  return out;
}

Result<std::vector<ReportReceipt>> receipts_of(const DemoRecord& record) {
  auto reader = LedgerReader::open(record.data_dir);
  if (!reader) return tl::unexpected(reader.error());
  const auto receipt = reader->receipt(record.burst);
  if (!receipt) return tl::unexpected(receipt.error());
  std::vector<ReportReceipt> out;
  for (const auto& line : receipt->cameras)
    out.push_back({line.camera, line.pulses, line.frames, line.losses});
  return out;
}

std::vector<std::pair<std::string, std::string>> parameters_of(const DemoRecord& record) {
  char host[256] = {};
  gethostname(host, sizeof host - 1);
  const Grid& g = record.processing.grid;
  std::vector<std::pair<std::string, std::string>> out = {
      {"program", concat("flamefield ", program_version())},
      {"host", host},
      {"flame", record.options.flame ? record.options.flame->string() : "stratified (simulated)"},
      {"seed", concat(record.options.seed)},
      {"cameras", concat(record.options.cameras, " simulated GigE Vision devices, 659x494 px, ",
                         name_of(record.options.pixel_format))},
      {"trigger rate", concat(record.options.rate_hz, " Hz")},
      {"board poses", concat(record.options.poses)},
      {"grid", concat(g.nx, " x ", g.ny, " x ", g.nz, " voxels of ", g.spacing_mm.x(), " mm")},
      {"rig", record.processing.rig_id},
      {"solver", record.processing.recipe.solver},
      {"recipe", fingerprint(record.processing.recipe)},
      {"burst", record.burst},
      {"mean of all pulses",
       fmt::format("one volume; Pearson {:.4f}, SqMD {:.4f} with the mean of the known flames",
                   record.summary.pearson_of_mean, record.summary.sqmd_of_mean)}};
  for (const auto& [key, value] : record.processing.recipe.settings) out.emplace_back(key, text_of(value));
  return out;
}

std::vector<std::string> commands_of(const DemoRecord& record) {
  const std::string data = record.data_dir.string();
  std::vector<std::string> out = {"deploy/quickstart --out " + record.options.out.string(),
                                  "flamefield runs list --data " + data,
                                  "flamefield runs receipt " + record.burst + " --data " + data};
  if (!record.pulses.empty()) {
    out.push_back("flamefield show " +
                  (record.data_dir / record.pulses.front().run.run.volume_path).string() +
                  " --out flame.png");
  }
  out.push_back("sqlite3 " + data + "/ledger.sqlite 'SELECT * FROM runs'");
  return out;
}

}  // namespace

Result<> write_demo_report(const std::filesystem::path& path, const DemoRecord& record,
                           Operator& at_the_burner) {
  if (record.pulses.empty()) {
    return data_loss("no volume of the burst", "there is nothing to report", "see 'flamefield runs receipt'");
  }
  const EvaluatedRun& shown = record.pulses[record.pulses.size() / 2];
  const DemoSummary& s = record.summary;
  ReportData data;
  data.title = "From the burner to the volume";
  data.subtitle = fmt::format("{} simulated GigE cameras, {} pulses at {} Hz", record.options.cameras,
                              s.pulses, record.options.rate_hz);
  data.created = utc_now();
  data.pulses = s.pulses;
  data.sets = s.sets;
  data.volumes = s.volumes;
  data.pulse_period_ms = 1000 / record.options.rate_hz;
  data.job_wall_s = s.job_wall_s;
  data.preparation = shown.run.run.provenance;
  data.field = field_of(shown, record);
  data.calibration = calibration_of(record);
  data.parameters = parameters_of(record);
  data.commands = commands_of(record);
  for (const EvaluatedRun& run : record.pulses) {
    data.per_pulse.push_back({run.set.pulse, run.metrics.pearson, run.metrics.sqmd, run.run.run.residual,
                              pulse_to_set_ms(run), set_to_volume_ms(run)});
    data.film.push_back({run.set.pulse, run.volume});
  }
  auto images = images_of(shown, record, at_the_burner);
  if (!images) return tl::unexpected(images.error());
  data.images = std::move(*images);
  auto receipts = receipts_of(record);
  if (!receipts) return tl::unexpected(receipts.error());
  data.receipts = std::move(*receipts);
  return write_report(path, data);
}

}  // namespace flamefield
