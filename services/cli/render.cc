#include "reconstruct/render.h"

#include <CLI/CLI.hpp>
#include <iostream>

#include "services/cli/commands.h"
#include "services/cli/options.h"
#include "services/cli/progress.h"
#include "services/store/projection_file.h"
#include "services/store/rig_file.h"
#include "services/store/volume_file.h"

namespace flamefield {

namespace {

struct Options {
  std::filesystem::path volume, rig, out;
  std::optional<double> spacing_mm;
  RenderOptions render;
  SensorNoise noise;
};

// View by view, so that a stop need not wait for all of them.
Projections render_stoppable(const Volume& volume, const Rig& rig, const Options& options,
                             const Session& session) {
  Projections all;
  ProgressBar progress("rendering");
  for (const Camera& camera : rig.cameras) {
    Rig one;
    one.cameras.push_back(camera);
    Projections view = or_fail_about(options.rig, render(volume, one, options.render));
    if (all.views() > 0 && (view.rows != all.rows || view.cols != all.cols)) {
      throw CommandFailure{ExitCode::Failed,
                           concat("camera '", camera.name, "' of '", options.rig.string(), "' has images of ",
                                  view.cols, " x ", view.rows, " px (the cameras before it have ", all.cols,
                                  " x ", all.rows, ") render cameras of one image size")};
    }
    all.rows = view.rows;
    all.cols = view.cols;
    all.view_names.push_back(camera.name);
    all.values.insert(all.values.end(), view.values.begin(), view.values.end());
    progress.update(static_cast<double>(all.views()), static_cast<double>(rig.cameras.size()), camera.name);
    session.check_stop();
  }
  return all;
}

void run(const Options& options, const Session& session) {
  check_projection_output(options.out);
  const Volume volume = or_fail(read_volume(options.volume, options.spacing_mm));
  const Rig rig = or_fail(read_rig(options.rig));
  Projections projections = render_stoppable(volume, rig, options, session);
  add_noise(projections, options.noise);
  session.check_stop();
  or_fail(write_projections(options.out, projections,
                            {{"program", concat("flamefield ", program_version())},
                             {"rig_fingerprint", fingerprint(rig)},
                             {"step_voxels", concat(options.render.step_voxels)},
                             {"pixel_samples", concat(options.render.pixel_samples)},
                             {"photons", concat(options.noise.photons)},
                             {"read_noise", concat(options.noise.read_noise)},
                             {"bits", concat(options.noise.bits)},
                             {"seed", concat(options.noise.seed)}}));
  std::cout << options.out.string() << ": " << projections.views() << " views of " << projections.cols
            << " x " << projections.rows << " px\n";
}

}  // namespace

void add_render(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand("render", "Take pictures of a known field: line-of-sight integrals");
  command->add_option("--volume", options->volume, "Field to look at")->required();
  add_npy_spacing(*command, options->spacing_mm);
  command->add_option("--rig", options->rig, "Cameras: rig.yaml")->required();
  command->add_option("--step-voxels", options->render.step_voxels, "Step along a ray, in voxels")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--pixel-samples", options->render.pixel_samples, "K x K rays a pixel")
      ->check(CLI::Range(1, 16))
      ->capture_default_str();
  command->add_option("--photons", options->noise.photons, "Photons at the brightest pixel; 0: no shot noise")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--read-noise", options->noise.read_noise, "Standard deviation in electrons")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--bits", options->noise.bits, "Quantisation; 0: none")
      ->check(CLI::Range(0, 24))
      ->capture_default_str();
  command->add_option("--seed", options->noise.seed, "Of the noise")->capture_default_str();
  command->add_option("--threads", options->render.threads, "0: all")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command->add_option("--out", options->out, "Projections to write: .nxs .npy .tif")->required();
  command->footer(
      "Example:\n  flamefield render --volume truth.vtkhdf --rig rig.yaml --photons 20000 --bits 12 --out "
      "projections.nxs");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
