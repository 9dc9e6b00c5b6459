#include "services/serve/gateway_sources.h"

#include <algorithm>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>

#include "services/bus/client.h"
#include "services/ledger/reader.h"
#include "services/report/picture.h"
#include "services/serve/prometheus.h"
#include "services/serve/records_json.h"
#include "services/store/volume_file.h"
#include "services/worker/best_so_far.h"

namespace flamefield {

namespace {

using Json = nlohmann::ordered_json;
using std::chrono::milliseconds;

// One question at a time to each service, from whichever thread the page's request runs in.
class LiveServices {
 public:
  LiveServices(Bus& bus, std::string role, std::string acquisition, std::string dispatcher,
               std::filesystem::path data_dir)
      : bus_(bus),
        role_(std::move(role)),
        acquisition_(std::move(acquisition)),
        dispatcher_(std::move(dispatcher)),
        data_dir_(std::move(data_dir)) {}

  template <class Answer>
  Result<Answer> ask_array(const Message& question) {
    auto client = Client::connect(bus_, role_, unique_name("gateway"), acquisition_);
    if (!client) return tl::unexpected(client.error());
    return client->ask_for<Answer>(question, kPatience);
  }
  Result<Status> status() {
    auto client = Client::connect(bus_, role_, unique_name("gateway"), dispatcher_);
    if (!client) return tl::unexpected(client.error());
    return client->ask_for<Status>(GetStatus{}, kPatience);
  }
  Result<LedgerReader> ledger() const { return LedgerReader::open(data_dir_); }
  const std::filesystem::path& data_dir() const { return data_dir_; }

 private:
  static constexpr milliseconds kPatience{1500};
  Bus& bus_;
  const std::string role_, acquisition_, dispatcher_;
  const std::filesystem::path data_dir_;
};

// The newest volume's picture, drawn once however many browsers look.
class NewestPicture {
 public:
  std::optional<std::string> png(const std::filesystem::path& volume_path, const std::string& run,
                                 const char* title = "Newest volume") {
    const std::scoped_lock lock(mutex_);
    std::error_code problem;
    const auto written = std::filesystem::last_write_time(volume_path, problem);
    if (run == run_ && written == written_) return png_;
    const auto volume = read_volume(volume_path);
    if (!volume) return std::nullopt;
    const auto picture = volume_picture(*volume, {.title = title, .subtitle = run});
    if (!picture) return std::nullopt;
    run_ = run;
    written_ = written;
    png_ = png_from(*picture);
    return png_;
  }

 private:
  std::mutex mutex_;
  std::string run_, png_;
  std::filesystem::file_time_type written_;
};

std::int64_t lost_frames(const CaptureState& state) {
  std::int64_t lost = 0;
  for (const auto& camera : state.cameras) {
    for (const auto& [cause, count] : camera.losses) lost += count;
  }
  return lost;
}

// Volumes of one set each that a capture has led to.
std::int64_t volumes_of(LiveServices& services, const std::string& capture) {
  auto reader = services.ledger();
  if (!reader) return 0;
  const auto receipt = reader->receipt(capture);
  return receipt ? receipt->volumes : 0;
}

std::optional<RunRow> newest_run(LiveServices& services) {
  auto reader = services.ledger();
  if (!reader) return std::nullopt;
  const auto rows = reader->runs({.limit = 1});
  return rows && !rows->empty() ? std::optional(rows->front()) : std::nullopt;
}

std::string status_json(LiveServices& services, const std::filesystem::path& report) {
  Json json = Json::object();
  std::int64_t pulses = 0, sets = 0, volumes = 0, lost = 0;
  if (const auto array = services.ask_array<CaptureState>(GetCapture{})) {
    Json cameras = Json::array();
    for (const auto& camera : array->cameras) {
      std::int64_t camera_lost = 0;
      for (const auto& [cause, count] : camera.losses) camera_lost += count;
      cameras.push_back(
          {{"name", camera.name}, {"state", camera.connected ? "ok" : "lost"}, {"lost_frames", camera_lost}});
    }
    json["array"] = {{"state", is_capturing(array->phase) ? "capturing" : name_of(array->phase)},
                     {"trouble", array->trouble},
                     {"cameras", std::move(cameras)}};
    if (!array->id.empty()) {
      json["capture"] = {{"id", array->id}, {"kind", name_of(array->kind)}};
      volumes = volumes_of(services, array->id);
    }
    sets = array->sets_stored;
    pulses = array->sets;
    lost = lost_frames(*array);
    json["preview_pulse"] = concat(array->id, "/", array->sets);
  }
  if (const auto status = services.status()) {
    json["counters"] = {{"pulses", pulses},         {"sets", sets},
                        {"volumes", volumes},       {"queued", status->queued + status->leased},
                        {"failed", status->failed}, {"lost_frames", lost}};
  }
  if (const auto run = newest_run(services)) json["newest_run"] = run->run.id;
  std::error_code code;
  if (!report.empty() && std::filesystem::exists(report, code))
    json["report"] = "/report/" + report.filename().string();
  return json.dump();
}

std::string runs_json(LiveServices& services) {
  Json runs = Json::array();
  auto reader = services.ledger();
  if (reader) {
    if (const auto rows = reader->runs({.limit = 200})) {
      for (const RunRow& row : *rows) {
        const auto finished = static_cast<double>(row.run.finished_time_ns - row.run.started_time_ns) * 1e-9;
        runs.push_back(
            {{"id", row.run.id},
             {"capture", row.run.inputs.front().capture},
             {"pulse", row.run.inputs.size() == 1 ? Json(row.run.inputs.front().index + 1) : Json("mean")},
             {"state", "done"},
             {"solver", row.run.solver},
             {"residual", row.run.residual},
             {"wall_s", finished},
             {"finished_utc", utc_text(row.run.finished_time_ns)},
             {"volume", "/" + row.run.volume_path}});
      }
    }
  }
  std::ranges::reverse(runs);
  return Json{{"runs", std::move(runs)}}.dump();
}

std::optional<std::string> preview_png(LiveServices& services, std::string_view camera) {
  const auto data = services.ask_array<SetData>(GetPreview{std::string(camera)});
  if (!data || data->set.frames.empty()) return std::nullopt;
  const Frame& frame = data->set.frames.front();
  const auto image = grey_levels(frame);
  if (!image) return std::nullopt;
  const double full_scale = (1 << bits_of(frame.format)) - 1;
  return png_from(coloured(*image, inferno(), {0, full_scale}));
}

}  // namespace

GatewaySources gateway_sources(Bus& bus, const std::string& role, const std::string& acquisition_endpoint,
                               const std::string& dispatcher_endpoint, const std::filesystem::path& data_dir,
                               const std::filesystem::path& report) {
  auto services =
      std::make_shared<LiveServices>(bus, role, acquisition_endpoint, dispatcher_endpoint, data_dir);
  auto picture = std::make_shared<NewestPicture>();
  GatewaySources sources;
  sources.status_json = [=] { return status_json(*services, report); };
  sources.runs_json = [=] { return runs_json(*services); };
  sources.metrics_text = [=] {
    const auto array = services->ask_array<CaptureState>(GetCapture{});
    const auto status = services->status();
    return prometheus_text(array ? std::optional(*array) : std::nullopt,
                           status ? std::optional(*status) : std::nullopt);
  };
  sources.run_json = [=](std::string_view id) -> std::optional<std::string> {
    auto reader = services->ledger();
    if (!reader) return std::nullopt;
    const auto run = reader->run(std::string(id));
    if (!run) return std::nullopt;
    Json json = json_of(*run);
    json["history"] = json_of(run->run.history);
    return json.dump();
  };
  sources.receipt_json = [=](std::string_view capture) -> std::optional<std::string> {
    auto reader = services->ledger();
    if (!reader) return std::nullopt;
    const auto receipt = reader->receipt(std::string(capture));
    return receipt ? std::optional(json_of(*receipt).dump()) : std::nullopt;
  };
  sources.preview_png = [=](std::string_view camera) { return preview_png(*services, camera); };
  sources.newest_volume_png = [=]() -> std::optional<std::string> {
    if (const auto best = find_best_so_far(services->data_dir()))
      return picture->png(best->path, best->run_id, "Best so far");
    const auto run = newest_run(*services);
    return run ? picture->png(services->data_dir() / run->run.volume_path, run->run.id) : std::nullopt;
  };
  sources.volumes_folder = data_dir / "volumes";
  if (!report.empty()) sources.report_folder = report.parent_path();
  return sources;
}

}  // namespace flamefield
