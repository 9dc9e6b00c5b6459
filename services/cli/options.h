#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "proto/volume.h"
#include "services/cli/app.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace flamefield {

// --size, --spacing-mm and --origin-mm: the reconstruction domain.
struct DomainOptions {
  std::vector<int> size;
  double spacing_mm = 1;
  std::vector<double> origin_mm;  // empty: centred on the world origin

  Grid grid() const;  // ends the command with exit code 2 when it is no valid grid
};
void add_domain(CLI::App& command, DomainOptions& options, bool is_size_required);

// --spacing-mm of .npy volumes.
void add_npy_spacing(CLI::App& command, std::optional<double>& spacing_mm);

double rad_of_deg(double angle_deg);

// Ends the command now, before the work, when a volume or projection file could not be written later.
void check_volume_output(const std::filesystem::path& path);
void check_projection_output(const std::filesystem::path& path);

}  // namespace flamefield
