#include "reconstruct/prepare.h"

#include <CLI/CLI.hpp>
#include <iostream>

#include "services/cli/commands.h"
#include "services/cli/options.h"
#include "services/cli/pictures.h"
#include "services/cli/progress.h"
#include "services/cli/recipe_options.h"
#include "services/report/preparation_picture.h"
#include "services/store/file.h"
#include "services/store/frame_file.h"
#include "services/store/projection_file.h"
#include "services/store/rig_file.h"

namespace flamefield {

namespace {

struct Options {
  std::filesystem::path frames, rig, out, rig_out, pictures;
  RecipeOptions recipe;
  DomainOptions domain;
};

std::vector<FrameSet> sets_of(const std::vector<FrameSet>& sets, CaptureKind kind) {
  std::vector<FrameSet> chosen;
  for (const FrameSet& set : sets)
    if (set.kind == kind) chosen.push_back(set);
  return chosen;
}

// Empty when the file has no sets of this kind.
MeanImages mean_of(const std::vector<FrameSet>& sets, CaptureKind kind, const std::filesystem::path& path) {
  return or_fail_about(path, mean_images(sets_of(sets, kind)));
}

MeanImages flame_of(const std::vector<FrameSet>& sets, const PhaseLock& phase,
                    const std::filesystem::path& path) {
  std::vector<FrameSet> flame = sets_of(sets, CaptureKind::Burst);
  if (flame.empty()) flame = sets_of(sets, CaptureKind::Live);
  if (flame.empty()) {
    throw CommandFailure{ExitCode::Failed, concat("'", path.string(),
                                                  "' has no frames of a flame (neither burst nor "
                                                  "live sets are in it) record a burst")};
  }
  return or_fail_about(path, mean_images(or_fail_about(path, phase_locked(flame, phase))));
}

Image image_of_view(const Projections& projections, std::size_t view) {
  Image image(projections.cols, projections.rows);
  const auto values = projections.view(view);
  image.pixels.assign(values.begin(), values.end());
  return image;
}

// One picture a camera and one of all.
void write_pictures(const std::filesystem::path& folder, const Preparer& preparer, const MeanImages& flame,
                    const Prepared& prepared, const Grid& domain, const Session& session) {
  const Eigen::Vector3d centre = 0.5 * (domain.lower_mm() + domain.upper_mm());
  ProgressBar progress("drawing");
  std::vector<PreparationSteps> all;
  for (std::size_t v = 0; v < preparer.views(); ++v) {
    const Camera& camera = preparer.camera(v);
    const Image& raw = flame.images.at(camera.name);
    all.push_back({camera, (camera.camera_from_world * centre).z(), raw, flame.full_scale,
                   preparer.map(v).window, preparer.corrected(v, raw), image_of_view(prepared.projections, v),
                   prepared.saturated[v]});
  }
  write_picture(folder / "overview.png", preparation_sheet(all, "a.u."));
  for (const PreparationSteps& steps : all) {
    session.check_stop();
    write_picture(folder / (steps.camera.name + ".png"), preparation_picture(steps, "a.u."));
    progress.update(static_cast<double>(&steps - all.data()), static_cast<double>(all.size()));
  }
}

void run(const Options& options, const Session& session) {
  const PrepareOptions prepare_as = or_usage(prepare_options(options.recipe.recipe()));
  const Grid domain = options.domain.grid();
  check_projection_output(options.out);
  auto rig_out = options.rig_out;
  if (rig_out.empty())
    rig_out = std::filesystem::path(options.out).replace_filename(options.out.stem().string() + "-rig.yaml");
  or_fail(check_writable(rig_out));
  const Rig rig = or_fail(read_rig(options.rig));
  const std::vector<FrameSet> sets = or_fail(read_frames(options.frames));
  session.check_stop();
  const auto mean = [&](CaptureKind kind) { return mean_of(sets, kind, options.frames); };
  const MeanImages flame = flame_of(sets, prepare_as.phase, options.frames);
  const References references{mean(CaptureKind::Dark), mean(CaptureKind::Background),
                              mean(CaptureKind::Flat)};
  session.check_stop();
  const Rig cameras = or_fail_about(options.frames, rig_of_images(rig, flame.images));
  Team team;
  const Preparer preparer =
      or_fail_about(options.frames, Preparer::make(cameras, references, domain, prepare_as, team));
  const Prepared prepared = or_fail_about(options.frames, preparer(flame, team));
  session.check_stop();
  Provenance provenance = {{"program", concat("flamefield ", program_version())},
                           {"frames", options.frames.filename().string()},
                           {"rig_fingerprint", fingerprint(rig)}};
  for (std::size_t i = 0; i < prepared.provenance.size(); ++i)
    provenance[concat("step_", i < 10 ? "0" : "", i)] = prepared.provenance[i];
  or_fail(write_rig(rig_out, prepared.rig));
  or_fail(write_projections(options.out, prepared.projections, provenance));
  if (!options.pictures.empty()) write_pictures(options.pictures, preparer, flame, prepared, domain, session);
  for (const std::string& step : prepared.provenance) std::cout << step << '\n';
  std::cout << options.out.string() << ": " << prepared.projections.views() << " views of "
            << prepared.projections.cols << " x " << prepared.projections.rows << " px; their cameras are in "
            << rig_out.string() << '\n';
}

}  // namespace

void add_prepare(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  options->domain.size = {52, 55, 52};
  auto* command = app.add_subcommand("prepare", "Turn recorded frames into projections");
  command->add_option("FRAMES", options->frames, "Recorded frame sets: .nxs with dark, background and burst")
      ->required();
  command->add_option("--rig", options->rig, "Cameras: rig.yaml")->required();
  add_recipe(*command, options->recipe);
  add_domain(*command, options->domain, false);
  command->add_option("--out", options->out, "Projections to write: .nxs .npy .tif")->required();
  command->add_option("--rig-out", options->rig_out,
                      "The level cameras of the projections. Default: beside OUT, as NAME-rig.yaml");
  command->add_option("--pictures", options->pictures,
                      "Folder for pictures before and after, of each camera");
  command->footer(
      "The domain (default 52,55,52 voxels of 1 mm) says what is cut out and how wide a pixel becomes: about "
      "a "
      "voxel.\nImages are averaged over the burst, or over one phase of it: --set prepare.every=4, or --set "
      "prepare.phase_hz=120 --set prepare.phase_bin=2.\n"
      "Example:\n  flamefield prepare run.nxs --rig rig.yaml --recipe prepare.toml --out projections.nxs "
      "--rig-out "
      "level.yaml");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
