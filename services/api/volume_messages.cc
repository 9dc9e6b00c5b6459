#include "services/api/volume_messages.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "services/gateway/notice_board.h"
#include "services/report/colour_map.h"
#include "services/report/rgb_image.h"
#include "services/report/slices.h"

namespace flamefield {
namespace {

using Json = nlohmann::ordered_json;

Json triple(const Eigen::Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

}  // namespace

Result<std::string> volume_message(const Volume& volume, const RunRow& row, std::int64_t pulse_time_ns,
                                   const VolumeForm& form) {
  const Volume small = reduced(volume, form.most_side);
  float low = 0, high = 0;
  for (const float value : small.values) {
    if (!std::isfinite(value))
      return invalid_input("volume of run " + row.run.id, "it holds NaN or infinity", "reconstruct it again");
    low = std::min(low, value);
    high = std::max(high, value);
  }
  const double full_scale = form.bits > 8 ? 65535 : 255;
  const double steps = high > low ? full_scale / (double{high} - double{low}) : 0;
  std::string payload;
  payload.reserve(small.values.size() * (form.bits > 8 ? 2 : 1));
  for (const float value : small.values) {
    const auto stored = static_cast<std::uint32_t>(std::lround((double{value} - double{low}) * steps));
    payload += static_cast<char>(stored & 0xff);
    if (form.bits > 8) payload += static_cast<char>(stored >> 8);
  }
  const Grid& grid = small.grid;
  const SetId first = row.run.inputs.empty() ? SetId{} : row.run.inputs.front();
  const Json head = {{"topic", "volume"},
                     {"run", row.run.id},
                     {"capture", first.capture},
                     {"index", first.index},
                     {"inputs", row.run.inputs.size()},
                     {"solver", row.run.solver},
                     {"size", {grid.nx, grid.ny, grid.nz}},
                     {"spacing_mm", triple(grid.spacing_mm)},
                     {"origin_mm", triple(grid.origin_mm)},
                     {"full_size", {volume.grid.nx, volume.grid.ny, volume.grid.nz}},
                     {"low", low},
                     {"high", high},
                     {"bits", form.bits > 8 ? 16 : 8},
                     {"pulse_time_ns", pulse_time_ns},
                     {"committed_time_ns", row.committed_time_ns},
                     {"is_unfinished", row.committed_time_ns == 0}};
  return framed(head.dump(), payload);
}

Result<std::string> thumbnail_png(const Volume& volume) {
  const Volume small = reduced(volume, 64);
  const Grid& grid = small.grid;
  Image image(grid.nx, grid.ny);
  for (int z = 0; z < grid.nz; ++z) {
    for (int y = 0; y < grid.ny; ++y) {
      for (int x = 0; x < grid.nx; ++x) {
        float& brightest = image.at(x, grid.ny - 1 - y);
        brightest = std::max(brightest, small.at(x, y, z));
      }
    }
  }
  const float high = *std::ranges::max_element(image.pixels);
  return png_from(coloured(image, inferno(), {0, high > 0 ? double{high} : 1}));
}

}  // namespace flamefield
