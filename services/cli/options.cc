#include "services/cli/options.h"

#include <CLI/CLI.hpp>
#include <numbers>

#include "services/store/file.h"
#include "services/store/projection_file.h"
#include "services/store/volume_file.h"

namespace flamefield {

Grid DomainOptions::grid() const {
  Grid grid = centred_grid(size[0], size[1], size[2], spacing_mm);
  if (!origin_mm.empty()) grid.origin_mm = Eigen::Vector3d(origin_mm[0], origin_mm[1], origin_mm[2]);
  or_usage(validate(grid));
  return grid;
}

void add_domain(CLI::App& command, DomainOptions& options, bool is_size_required) {
  auto* size = command.add_option("--size", options.size, "Voxels of the domain: NX,NY,NZ")
                   ->delimiter(',')
                   ->expected(3);
  if (is_size_required) size->required();
  command.add_option("--spacing-mm", options.spacing_mm, "Side of a voxel")->capture_default_str();
  command
      .add_option("--origin-mm", options.origin_mm,
                  "Centre of voxel (0,0,0): X,Y,Z. Default: the domain is centred on the world origin")
      ->delimiter(',')
      ->expected(3);
}

void add_npy_spacing(CLI::App& command, std::optional<double>& spacing_mm) {
  command.add_option("--spacing-mm", spacing_mm, "Side of a voxel, for .npy volumes (default 1)");
}

double rad_of_deg(double angle_deg) {
  return angle_deg * std::numbers::pi / 180;
}

void check_volume_output(const std::filesystem::path& path) {
  or_usage(check_volume_name(path));
  or_fail(check_writable(path));
}

void check_projection_output(const std::filesystem::path& path) {
  or_usage(check_projection_name(path));
  or_fail(check_writable(path));
}

}  // namespace flamefield
