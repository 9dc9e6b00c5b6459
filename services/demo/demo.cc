#include "services/demo/demo.h"

#include <chrono>
#include <thread>

#include "services/acquisition/operator.h"
#include "services/demo/calibration_session.h"
#include "services/demo/demo_report.h"
#include "services/demo/evaluation.h"
#include "services/demo/summary.h"
#include "services/serve/embedded.h"
#include "services/simulation/laboratory.h"
#include "services/store/rig_file.h"
#include "services/store/volume_file.h"

namespace flamefield {

namespace {

using std::chrono::seconds;
using std::chrono::steady_clock;

constexpr double kHeight_mm = 40;  // HAB of the ring's plane

Result<FlameFilmOptions> film_options(const DemoOptions& options) {
  FlameFilmOptions film;
  film.frames = options.pulses;
  film.frame_interval_s = 1 / options.rate_hz;
  film.seed = options.seed;
  film.grid = centred_grid(52, 55, 52, options.voxel_mm);
  if (options.flame) {
    const auto spacing =
        options.flame_spacing_mm > 0 ? std::optional(options.flame_spacing_mm) : std::nullopt;
    auto field = read_volume(*options.flame, spacing);
    if (!field) return tl::unexpected(field.error());
    const Eigen::Vector3d size_mm = field->grid.upper_mm() - field->grid.lower_mm();
    const auto voxels = [&](double mm) {
      return std::max(1, static_cast<int>(std::lround(mm / options.voxel_mm)));
    };
    film.grid = centred_grid(voxels(size_mm.x()), voxels(size_mm.y()), voxels(size_mm.z()), options.voxel_mm);
    field->grid.origin_mm = -0.5 * size_mm + 0.5 * field->grid.spacing_mm;
    field->grid.origin_mm.y() += kHeight_mm;
    film.field = std::move(*field);
  }
  film.grid.origin_mm.y() += kHeight_mm;
  return film;
}

// One demonstration from the empty folder to the report.
class Demo {
 public:
  Demo(const DemoOptions& options, const DemoProgress& progress, std::stop_token stop)
      : options_(options), progress_(progress), stop_(std::move(stop)), data_dir_(options.out / "data") {}

  Result<> run() {
    return open_laboratory()
        .and_then([&] { return start_services(); })
        .and_then([&] { return light_flame(); })
        .and_then([&] { return calibrate_ring(); })
        .and_then([&] { return capture_references(); })
        .and_then([&] { return capture_burst(); })
        .and_then([&] { return wait_for_volumes(); })
        .and_then([&] { return evaluate(); })
        .and_then([&] { return report(); });
  }
  const DemoSummary& summary() const { return summary_; }
  const std::string& page_url() const { return services_->page_url(); }

 private:
  auto stage(const std::string& name) {
    return [this, name](std::int64_t done, std::int64_t total) { progress_.step(name, done, total); };
  }
  Result<> keep_going() const {
    if (stop_.stop_requested())
      return unavailable("the demonstration", "stopped", "run it again: finished work is kept");
    return {};
  }

  Result<> open_laboratory();
  Result<> start_services();
  Result<> light_flame() {
    return laboratory_->light_flame(stage("light the flame (render every view)"), stop_);
  }
  Result<> calibrate_ring();
  Result<> capture_references();
  Result<> capture_burst();
  Result<> wait_for_volumes();
  Result<> evaluate();
  Result<> report();
  Result<std::string> capture(CaptureKind kind, std::int64_t pulses, const std::string& name);

  const DemoOptions& options_;
  const DemoProgress& progress_;
  const std::stop_token stop_;
  const std::filesystem::path data_dir_;
  const steady_clock::time_point started_ = steady_clock::now();

  std::unique_ptr<Laboratory> laboratory_;
  Bus bus_;
  std::unique_ptr<Embedded> services_;
  std::optional<Operator> operator_;
  std::optional<CalibrationReport> calibration_;
  Processing processing_;
  std::string burst_;
  std::vector<EvaluatedRun> pulses_;
  std::vector<EvaluatedRun> mean_;
  DemoSummary summary_;
};

Result<> Demo::open_laboratory() {
  LaboratoryOptions laboratory;
  laboratory.cameras = options_.cameras;
  laboratory.board_poses = options_.poses;
  laboratory.rate_hz = options_.rate_hz;
  laboratory.first_address = options_.first_address;
  laboratory.seed = options_.seed;
  laboratory.height_mm = kHeight_mm;
  auto film = film_options(options_);
  if (!film) return tl::unexpected(film.error());
  laboratory.film = std::move(*film);
  processing_.grid = laboratory.film.grid;
  auto opened = Laboratory::open(laboratory);
  if (!opened) return tl::unexpected(opened.error());
  laboratory_ = std::move(*opened);
  return {};
}

Result<> Demo::start_services() {
  EmbeddedOptions embedded;
  embedded.data_dir = data_dir_;
  embedded.http_port = options_.http_port == 0 ? -1 : options_.http_port;
  embedded.report = options_.out / "report.html";
  embedded.acquisition.settings = laboratory_->camera_settings(options_.pixel_format);
  embedded.acquisition.hooks = laboratory_->hooks();
  embedded.acquisition.cameras = laboratory_->cameras();
  auto services = Embedded::start(bus_, embedded);
  if (!services) return tl::unexpected(services.error());
  services_ = std::move(*services);
  auto connected = Operator::connect(bus_, "operator", "inproc://acquisition", "inproc://dispatcher");
  if (!connected) return tl::unexpected(connected.error());
  operator_.emplace(std::move(*connected));
  return {};
}

Result<std::string> Demo::capture(CaptureKind kind, std::int64_t pulses, const std::string& name) {
  const auto state = operator_->capture({.kind = kind, .pulses = pulses}, stage(name), stop_);
  if (!state) return tl::unexpected(state.error());
  if (auto ok = keep_going(); !ok) return tl::unexpected(ok.error());
  return state->id;
}

Result<> Demo::calibrate_ring() {
  const auto id = capture(CaptureKind::Board, options_.poses, "calibration session: board poses");
  if (!id) return tl::unexpected(id.error());
  const auto sets = operator_->fetch(*id, options_.poses);
  if (!sets) return tl::unexpected(sets.error());
  std::vector<std::string> cameras;
  for (const Camera& camera : laboratory_->true_rig().cameras) cameras.push_back(camera.name);
  auto report = calibrate_session(*sets, laboratory_->board(), laboratory_->world_from_reference_board(),
                                  cameras, stage("calibration session: find the corners"), stop_);
  if (!report) return tl::unexpected(report.error());
  calibration_ = std::move(*report);
  summary_.calibration_rms_px = calibration_->rms_px;
  const MeasuringVolume volume{laboratory_->world_from_reference_board().translation_mm};
  const auto error = volume_error_px(calibration_->rig, laboratory_->true_rig(), volume);
  if (!error) return tl::unexpected(error.error());
  summary_.volume_error_mean_px = error->mean_px;
  summary_.volume_error_worst_px = error->worst_px;
  summary_.volume_error_worst_camera = error->worst_camera;

  const auto stored = operator_->dispatcher().ask_for<RigStored>(PutRig{calibration_->rig}, seconds(10));
  if (!stored) return tl::unexpected(stored.error());
  processing_.rig_id = stored->rig_id;
  if (auto ok = write_rig(options_.out / "rig.yaml", calibration_->rig); !ok) return ok;
  return write_rig(options_.out / "true-rig.yaml", laboratory_->true_rig());
}

Result<> Demo::capture_references() {
  const std::int64_t pulses = options_.reference_pulses;
  const auto dark = capture(CaptureKind::Dark, pulses, "dark frames (lens caps on)");
  if (!dark) return tl::unexpected(dark.error());
  const auto background = capture(CaptureKind::Background, pulses, "background frames (no flame)");
  if (!background) return tl::unexpected(background.error());
  const auto flat = capture(CaptureKind::Flat, pulses, "flat field (evenly lit screen)");
  if (!flat) return tl::unexpected(flat.error());
  processing_.dark_capture = *dark;
  processing_.background_capture = *background;
  processing_.flat_capture = *flat;
  return {};
}

// Live: every set becomes a volume while the next ones are recorded.
Result<> Demo::capture_burst() {
  processing_.recipe = options_.recipe;
  processing_.recipe.settings["prepare.counts_per_unit"] =
      laboratory_->film().electrons_per_unit() * laboratory_->grey_levels_per_electron(options_.pixel_format);
  const auto planned =
      operator_->dispatcher().ask_for<Accepted>(LivePlan{.on = true, .processing = processing_}, seconds(10));
  if (!planned) return tl::unexpected(planned.error());
  const std::int64_t before = laboratory_->array().generator().pulses();
  const auto id = capture(CaptureKind::Burst, options_.pulses, "burst: record the flame");
  if (!id) return tl::unexpected(id.error());
  burst_ = *id;
  summary_.pulses = laboratory_->array().generator().pulses() - before;
  const auto submitted = operator_->dispatcher().ask_for<Submitted>(
      Submit{.captures = {burst_}, .sets = {}, .combine = Combine::Mean, .processing = processing_},
      seconds(10));
  if (!submitted) return tl::unexpected(submitted.error());
  return {};
}

Result<> Demo::wait_for_volumes() {
  const std::int64_t wanted = options_.pulses + 1;  // every pulse and the mean
  auto reader = LedgerReader::open(data_dir_);
  if (!reader) return tl::unexpected(reader.error());
  for (;;) {
    if (auto ok = keep_going(); !ok) return ok;
    if (const auto error = services_->failed()) return tl::unexpected(*error);
    const auto receipt = reader->receipt(burst_);
    if (!receipt) return tl::unexpected(receipt.error());
    stage("reconstruct every pulse and the mean")(receipt->volumes + receipt->combined_volumes, wanted);
    summary_.sets = receipt->sets;
    summary_.volumes = receipt->volumes;
    if (receipt->failed > 0) {
      return data_loss(concat(receipt->failed, " of ", receipt->sets, " sets gave no volume"),
                       receipt->failures.front().reason, "see 'flamefield runs receipt'");
    }
    if (receipt->volumes + receipt->combined_volumes >= receipt->sets + 1) return {};
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

Result<> Demo::evaluate() {
  const FlameFilm& film = laboratory_->film();
  auto pulses = evaluate_runs(data_dir_, burst_, 1,
                              [&](std::int64_t index) { return film.truth(static_cast<int>(index)); });
  if (!pulses) return tl::unexpected(pulses.error());
  pulses_ = std::move(*pulses);
  auto mean =
      evaluate_runs(data_dir_, burst_, summary_.sets, [&](std::int64_t) { return film.mean_truth(); });
  if (!mean) return tl::unexpected(mean.error());
  mean_ = std::move(*mean);
  for (const auto* runs : {&pulses_, &mean_}) {
    for (const EvaluatedRun& evaluated : *runs) {
      const PutMetrics found{
          evaluated.run.run.id,
          {{"pearson_3d", evaluated.metrics.pearson}, {"sqmd_3d", evaluated.metrics.sqmd}}};
      if (auto ok = operator_->dispatcher().ask_for<Accepted>(found, seconds(10)); !ok) {
        return tl::unexpected(ok.error());
      }
    }
  }
  summarise_runs(pulses_, mean_, summary_);
  return {};
}

Result<> Demo::report() {
  stage("write the report")(0, 1);
  summary_.job_wall_s = std::chrono::duration<double>(steady_clock::now() - started_).count();
  const DemoRecord record{options_,  *laboratory_, *calibration_, processing_, burst_,
                          data_dir_, pulses_,      mean_,         summary_};
  if (auto ok = write_demo_report(options_.out / "report.html", record, *operator_); !ok) return ok;
  summary_.job_wall_s = std::chrono::duration<double>(steady_clock::now() - started_).count();
  stage("write the report")(1, 1);
  return write_summary(options_.out / "summary.json", summary_);
}

}  // namespace

Result<DemoSummary> run_demo(const DemoOptions& options, const DemoProgress& progress, std::stop_token stop,
                             const std::function<void(const DemoSummary&, const std::string&)>& when_done) {
  std::error_code code;
  std::filesystem::create_directories(options.out, code);
  if (code)
    return invalid_input("cannot make " + options.out.string(), code.message(), "choose another --out");
  Demo demo(options, progress, stop);
  if (auto ok = demo.run(); !ok) return tl::unexpected(ok.error());
  when_done(demo.summary(), demo.page_url());
  return demo.summary();
}

}  // namespace flamefield
