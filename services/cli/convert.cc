#include <CLI/CLI.hpp>
#include <iostream>

#include "services/cli/commands.h"
#include "services/cli/options.h"
#include "services/store/frame_file.h"
#include "services/store/projection_file.h"
#include "services/store/rig_export.h"
#include "services/store/rig_file.h"
#include "services/store/volume_file.h"

namespace flamefield {

namespace {

struct Options {
  std::filesystem::path in, out, rig;
  std::optional<double> spacing_mm;
};

bool is_yaml(const std::filesystem::path& path) {
  return path.extension() == ".yaml" || path.extension() == ".yml";
}

// colmap/ or any other folder, kalibr or camchain.yaml, ring.cameramodel.
void convert_rig(const Options& options) {
  if (options.in.filename() == "camchain.yaml") {
    or_usage(options.out.extension() == ".yaml"
                 ? Result<>()
                 : invalid_input(options.out.string(), "a camera chain becomes a rig", "name it rig.yaml"));
    return or_fail(write_rig(options.out, or_fail(read_kalibr(options.in))));
  }
  const Rig rig = or_fail(read_rig(options.in));
  if (options.out.extension() == ".cameramodel") return or_fail(export_mrcal(options.out, rig));
  if (is_yaml(options.out)) return or_fail(export_kalibr(options.out, rig));
  const auto folder = options.out.has_filename() ? options.out : options.out.parent_path();
  if (folder.filename() != "kalibr") return or_fail(export_colmap(folder, rig));
  std::error_code ignored;  // writing says it better
  std::filesystem::create_directories(folder, ignored);
  or_fail(export_kalibr(folder / "camchain.yaml", rig));
}

void convert_projections(const Options& options) {
  check_projection_output(options.out);
  std::optional<Rig> rig;
  if (!options.rig.empty()) rig = or_fail(read_rig(options.rig));
  const Projections projections = or_fail(read_projections(options.in, rig ? &*rig : nullptr));
  or_fail(write_projections(options.out, projections, {{"converted_from", options.in.filename().string()}}));
}

void convert_volume(const Options& options) {
  check_volume_output(options.out);
  const VolumeRecord record = or_fail(read_volume_record(options.in, options.spacing_mm));
  Provenance provenance = record.provenance;
  provenance["converted_from"] = options.in.filename().string();
  or_fail(write_volume(options.out, record.volume, provenance, record.sigma));
}

void run(const Options& options, const Session& session) {
  session.check_stop();
  if (is_yaml(options.in)) {
    convert_rig(options);
  } else if (options.in.extension() == ".nxs" && options.out.extension().empty()) {
    or_fail(write_frame_tiffs(options.out, or_fail(FrameReader::open(options.in))));
  } else if (options.in.extension() == ".nxs" || options.out.extension() == ".nxs") {
    convert_projections(options);
  } else {
    or_usage(check_volume_name(options.in));
    convert_volume(options);
  }
  std::cout << options.out.string() << '\n';
}

}  // namespace

void add_convert(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand("convert", "Translate volumes, projections and rigs for other programs");
  command
      ->add_option(
          "IN", options->in,
          "Volume .vtkhdf .vti .tif .npy; projections .nxs .npy .tif; recording .nxs; rig.yaml; Kalibr's "
          "camchain.yaml")
      ->required();
  command
      ->add_option("OUT", options->out,
                   "The same; a recording becomes a folder of .tif; a rig becomes COLMAP's colmap/, Kalibr's "
                   "camchain.yaml or kalibr/, mrcal's .cameramodel")
      ->required();
  add_npy_spacing(*command, options->spacing_mm);
  command->add_option("--rig", options->rig, "Names of the views, for projections without");
  command->footer(
      "Examples:\n  flamefield convert volume.vtkhdf volume.tif\n  flamefield convert rig.yaml colmap/\n"
      "  flamefield convert field.npy field.vtkhdf --spacing-mm 0.5");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
