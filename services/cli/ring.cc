#include "reconstruct/ring.h"

#include <CLI/CLI.hpp>
#include <iostream>

#include "reconstruct/phantom/setup.h"
#include "services/cli/commands.h"
#include "services/cli/options.h"
#include "services/config/suggestion.h"
#include "services/store/file.h"
#include "services/store/rig_file.h"
#include "services/store/volume_file.h"

namespace flamefield {

namespace {

struct Options {
  std::string like;  // a phantom
  std::optional<int> views;
  std::optional<double> spacing_deg, radius_mm;
  double elevation_deg = 0;
  std::filesystem::path volume;
  std::optional<double> spacing_mm;
  std::vector<int> image;
  std::filesystem::path out;
};

// What the command line says, else what the article did for a phantom.
RingOptions ring_of(const Options& options) {
  RingOptions ring;
  if (!options.like.empty()) {
    const auto kind = phantom_kind_from_name(options.like);
    if (!kind)
      throw CommandFailure{ExitCode::Usage,
                           concat("unknown phantom '", options.like, "' (there is none of this name) ",
                                  suggest(options.like, {"torus", "hollow-sphere", "gaussian", "bunsen",
                                                         "swirl", "stratified"}))};
    ring = paper_setup(*kind).ring();
    ring.image_width_px = paper_setup(*kind).nx, ring.image_height_px = paper_setup(*kind).ny;
  } else if (!options.views || !options.spacing_deg || !options.radius_mm) {
    throw CommandFailure{
        ExitCode::Usage,
        "the ring is not clear (--views, --spacing-deg and --radius-mm go together) give all three, "
        "or --like with a phantom"};
  }
  ring.views = options.views.value_or(ring.views);
  if (options.spacing_deg) ring.spacing_rad = rad_of_deg(*options.spacing_deg);
  ring.radius_mm = options.radius_mm.value_or(ring.radius_mm);
  ring.elevation_rad = rad_of_deg(options.elevation_deg);
  return ring;
}

void run(const Options& options, const Session& session) {
  or_fail(check_writable(options.out));
  const Volume volume = or_fail(read_volume(options.volume, options.spacing_mm));
  RingOptions ring = ring_of(options);
  if (!options.image.empty()) {
    ring.image_width_px = options.image[0];
    ring.image_height_px = options.image[1];
  }
  const Rig rig = or_usage(make_ring(ring, volume.grid));
  session.check_stop();
  or_fail(write_rig(options.out, rig));
  const Camera& first = rig.cameras.front();
  std::cout << options.out.string() << ": " << rig.cameras.size() << " cameras of " << first.image_width_px
            << " x " << first.image_height_px << " px, focal length " << first.fx_px << " px\n";
}

}  // namespace

void add_ring(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand("ring", "Place a ring of equal cameras around a volume");
  command->add_option("--like", options->like,
                      "As the article saw a phantom, e.g. bunsen: views, spacing, radius and image size");
  command->add_option("--views", options->views, "Number of cameras");
  command->add_option("--spacing-deg", options->spacing_deg, "Azimuth between neighbours");
  command->add_option("--radius-mm", options->radius_mm, "Camera centre to the centre of the domain");
  command->add_option("--elevation-deg", options->elevation_deg, "Above the horizontal plane")
      ->capture_default_str();
  command->add_option("--volume", options->volume, "Volume that fills the view")->required();
  add_npy_spacing(*command, options->spacing_mm);
  command->add_option("--image", options->image, "Image size W,H in px. Default: NX,NY of the volume")
      ->delimiter(',')
      ->expected(2);
  command->add_option("--out", options->out, "Rig to write: rig.yaml")->required();
  command->footer(
      "Examples:\n  flamefield ring --views 15 --spacing-deg 12 --radius-mm 300 --volume truth.vtkhdf "
      "--image "
      "52,55 "
      "--out rig.yaml\n  flamefield ring --like bunsen --volume truth.vtkhdf --out rig.yaml");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
