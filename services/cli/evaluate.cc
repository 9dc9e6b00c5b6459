#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>

#include "reconstruct/metrics.h"
#include "reconstruct/render.h"
#include "services/cli/commands.h"
#include "services/cli/options.h"
#include "services/cli/pictures.h"
#include "services/report/comparison_picture.h"
#include "services/report/field_plots.h"
#include "services/store/projection_file.h"
#include "services/store/rig_file.h"
#include "services/store/volume_file.h"

namespace flamefield {

namespace {

struct Options {
  std::filesystem::path truth, volume, rig, projections, pictures;
  std::optional<double> spacing_mm;
  bool json = false;
};

// How well the volume explains the pictures; nothing without them.
struct ImageMetrics {
  std::vector<double> residual_per_view;
  double mean_sqmd = 0;
};

std::optional<ImageMetrics> image_metrics(const Options& options, const Volume& volume) {
  if (options.rig.empty() != options.projections.empty()) {
    throw CommandFailure{ExitCode::Usage,
                         "--rig and --projections (one was given without the other) give both or none"};
  }
  if (options.rig.empty()) return std::nullopt;
  const Rig whole_rig = or_fail(read_rig(options.rig));
  const Projections reference = or_fail(read_projections(options.projections, &whole_rig));
  const Rig rig = or_fail(rig_of_views(whole_rig, reference, options.rig));
  const Projections rendered = or_fail_about(options.rig, render(volume, rig, {}));
  if (rendered.rows != reference.rows || rendered.cols != reference.cols) {
    throw CommandFailure{ExitCode::Failed,
                         concat("'", options.projections.string(), "' has images of ", reference.cols, " x ",
                                reference.rows, " px (the rig says ", rendered.cols, " x ", rendered.rows,
                                ") take the rig that belongs to them")};
  }
  return ImageMetrics{residual_per_view(reference, rendered), mean_sqmd(reference, rendered)};
}

nlohmann::json json_of(const FieldMetrics& field, const std::optional<ImageMetrics>& images) {
  nlohmann::json slices;
  const std::array<const char*, 3> axes = {"x", "y", "z"};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    auto& list = slices[axes[axis]] = nlohmann::json::array();
    for (const SliceMetrics& slice : field.slices[axis])
      list.push_back({{"index", slice.index}, {"pearson", slice.pearson}, {"sqmd", slice.sqmd}});
  }
  nlohmann::json json = {{"pearson_3d", field.pearson}, {"sqmd_3d", field.sqmd}, {"rmse", field.rmse},
                         {"psnr_db", field.psnr_db},    {"ssim", field.ssim},    {"slices", slices}};
  json["sqmd_2d_mean"] = images ? nlohmann::json(images->mean_sqmd) : nlohmann::json();
  json["residual_per_view"] = images ? nlohmann::json(images->residual_per_view) : nlohmann::json();
  return json;
}

// The spacing on the command line is for those files that do not know their own.
Volume read_field(const std::filesystem::path& path, std::optional<double> spacing_mm) {
  return or_fail(read_volume(path, path.extension() == ".npy" ? spacing_mm : std::nullopt));
}

void write_pictures(const std::filesystem::path& folder, const Volume& truth, const Volume& volume,
                    const FieldMetrics& field) {
  write_volume_picture(folder / "truth.png", truth, {.title = "Known field"});
  write_volume_picture(folder / "volume.png", volume, {.title = "Reconstructed field"});
  write_picture(folder / "slices.png", comparison_picture(truth, volume, field, "a.u."));
  write_picture(folder / "correlation_hab.png", png_of(height_plot(volume.grid, field)));
  write_picture(folder / "scatter.png", png_of(scatter_plot(truth, volume, "a.u.")));
}

void run(const Options& options, const Session& session) {
  Volume truth = read_field(options.truth, options.spacing_mm);
  const Volume volume = read_field(options.volume, options.spacing_mm);
  const bool is_same_grid = truth.grid == volume.grid;
  if (!is_same_grid) truth = resample(truth, volume.grid);
  session.check_stop();
  const FieldMetrics field = or_fail_about(options.volume, compare(truth, volume));
  const auto images = image_metrics(options, volume);
  if (!options.pictures.empty()) write_pictures(options.pictures, truth, volume, field);
  session.check_stop();
  if (options.json) {
    std::cout << json_of(field, images).dump(2) << '\n';
    return;
  }
  std::cout << "Pearson  " << field.pearson << "\nSqMD     " << field.sqmd << "\nRMSE     " << field.rmse
            << "\nPSNR     " << field.psnr_db << " dB\nSSIM     " << field.ssim << '\n';
  if (images) std::cout << "SqMD 2D  " << images->mean_sqmd << " (mean over views)\n";
  if (!is_same_grid) std::cout << "(the known field was resampled to the grid of the volume)\n";
}

}  // namespace

void add_evaluate(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command =
      app.add_subcommand("evaluate", "Compare a volume with the known field, on the volume's grid");
  command->add_option("--truth", options->truth, "The known field; may be finer")->required();
  command->add_option("--volume", options->volume, "The volume to judge")->required();
  add_npy_spacing(*command, options->spacing_mm);
  command->add_option("--rig", options->rig, "With --projections: how well the volume explains them");
  command->add_option("--projections", options->projections, "What the volume was made from");
  command->add_option(
      "--pictures", options->pictures,
      "Folder for pictures: both fields, slices side by side, correlation against HAB, scatter");
  command->add_flag("--json", options->json, "Print the figures as JSON");
  command->footer("Example:\n  flamefield evaluate --truth truth.vtkhdf --volume volume.vtkhdf --json");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
