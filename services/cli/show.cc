#include <CLI/CLI.hpp>
#include <iostream>

#include "services/cli/commands.h"
#include "services/cli/options.h"
#include "services/cli/pictures.h"
#include "services/store/file.h"
#include "services/store/volume_file.h"

namespace flamefield {

namespace {

struct Options {
  std::filesystem::path volume, out;
  std::optional<double> spacing_mm;
  std::string title;
  double azimuth_deg = 35, elevation_deg = 17;
};

void run(const Options& options, const Session& session) {
  if (options.out.extension() != ".png") {
    throw CommandFailure{ExitCode::Usage,
                         concat("'", options.out.string(), "' as a picture (its extension is not .png) ",
                                "use --out picture.png")};
  }
  or_fail(check_writable(options.out));
  const VolumeRecord record = or_fail(read_volume_record(options.volume, options.spacing_mm));
  VolumePictureOptions picture;
  picture.azimuth_rad = rad_of_deg(options.azimuth_deg);
  picture.elevation_rad = rad_of_deg(options.elevation_deg);
  picture.title = options.title.empty() ? options.volume.filename().string() : options.title;
  if (const auto solver = record.provenance.find("solver"); solver != record.provenance.end())
    picture.subtitle = solver->second;
  write_volume_picture(options.out, record.volume, picture);
  session.check_stop();
  std::cout << options.out.string() << '\n';
}

}  // namespace

void add_show(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand("show", "Draw a volume: three slices and a rendered view");
  command->add_option("VOLUME", options->volume, "Volume to draw")->required();
  add_npy_spacing(*command, options->spacing_mm);
  command->add_option("--title", options->title, "Default: the file's name");
  command->add_option("--azimuth-deg", options->azimuth_deg, "Turntable angle of the view")
      ->capture_default_str();
  command->add_option("--elevation-deg", options->elevation_deg, "Of the view")->capture_default_str();
  command->add_option("--out", options->out, "Picture to write: .png")->required();
  command->footer("Example:\n  flamefield show volume.vtkhdf --out picture.png");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
