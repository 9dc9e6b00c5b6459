#include "services/plan/rates.h"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>

#include "reconstruct/phantom/phantom.h"
#include "reconstruct/render.h"
#include "reconstruct/ring.h"
#include "reconstruct/solver.h"
#include "services/bench/machine_limit.h"
#include "services/bench/stopwatch.h"

namespace flamefield {

namespace {

constexpr int kSmallSide = 48, kLargeSide = 96;  // voxels of the cubes that are tried
constexpr int kFew = 4, kMany = 12;              // iterations
// How often an iteration of the solvers reads or writes a whole set of images, beside the projector.
constexpr double kImagePasses = 14;

// From /proc/self/status, a line such as "VmHWM:   12345 kB".
double status_bytes(const std::string& name) {
  std::ifstream in("/proc/self/status");
  for (std::string word; in >> word;) {
    if (word != name) continue;
    double kib = 0;
    in >> kib;
    return 1024 * kib;
  }
  return 0;
}

// The most memory from here on begins with what is held now (Linux, proc(5), clear_refs).
void forget_peak() {
  ::malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << 5;
}

struct Trial {
  double voxels = 0, pixels = 0;
  double few_s = 0, many_s = 0;  // CPU
  double bytes = 0;
};

std::string iterations_key(const Recipe& recipe) {
  return recipe.solver + ".max_iterations";
}

Result<Trial> try_cube(int side, int views, Recipe recipe, std::stop_token stop) {
  const Grid grid = centred_grid(side, side, side, 52.0 / side);
  const Volume truth = make_phantom({.kind = PhantomKind::Stratified, .seed = 1}, grid);
  const auto rig = make_ring({.views = views,
                              .spacing_rad = std::numbers::pi / views,
                              .radius_mm = 300,
                              .image_width_px = side,
                              .image_height_px = side},
                             grid);
  if (!rig) return tl::unexpected(rig.error());
  const auto images = render(truth, *rig, {.step_voxels = 1, .threads = 1});
  if (!images) return tl::unexpected(images.error());
  Trial out;
  out.voxels = static_cast<double>(grid.voxels());
  out.pixels = static_cast<double>(images->values.size());
  for (const int iterations : {kFew, kMany}) {
    recipe.settings[iterations_key(recipe)] = std::int64_t{iterations};
    forget_peak();
    const double held = status_bytes("VmRSS:");
    const Stopwatch watch;
    const auto solved = reconstruct(*images, *rig, grid, recipe, {.threads = 1, .seed = 1, .stop = stop});
    if (!solved) return tl::unexpected(solved.error());
    (iterations == kFew ? out.few_s : out.many_s) = watch.cpu_s();
    out.bytes = std::max(out.bytes, status_bytes("VmHWM:") - held);
  }
  return out;
}

}  // namespace

std::optional<int> iterations_of(const Recipe& recipe) {
  for (const SettingDoc& doc : settings_of(recipe.solver)) {
    if (doc.key != "max_iterations") continue;
    const auto set = recipe.settings.find(iterations_key(recipe));
    if (set != recipe.settings.end() && std::holds_alternative<std::int64_t>(set->second))
      return static_cast<int>(std::get<std::int64_t>(set->second));
    return std::stoi(doc.default_value);
  }
  return std::nullopt;
}

Result<Rates> measure_rates(const Recipe& recipe, int views, std::stop_token stop,
                            const std::function<void(const std::string&)>& progress) {
  if (!iterations_of(recipe)) {
    return invalid_input(concat("no estimate for solver ", recipe.solver),
                         "its time does not follow from a number of iterations",
                         "plan from a ledger with runs of it (--data), or with --set-s and --set-mib");
  }
  Rates out;
  progress(concat("trying ", recipe.solver, " on ", kSmallSide, "^3 voxels"));
  // What the first solve loads of the program is no memory of the solver's.
  if (const auto first = try_cube(kSmallSide, views, recipe, stop); !first)
    return tl::unexpected(first.error());
  out.base_bytes = status_bytes("VmRSS:");
  const auto small = try_cube(kSmallSide, views, recipe, stop);
  if (!small) return tl::unexpected(small.error());
  progress(concat("trying ", recipe.solver, " on ", kLargeSide, "^3 voxels"));
  const auto large = try_cube(kLargeSide, views, recipe, stop);
  if (!large) return tl::unexpected(large.error());

  out.pixel_iteration_s = kImagePasses / measure_machine().memory_floats_per_s;
  const double iteration_s = (large->many_s - large->few_s) / (kMany - kFew);
  out.voxel_iteration_s = std::max(0.0, iteration_s - out.pixel_iteration_s * large->pixels) / large->voxels;
  out.voxel_set_up_s = std::max(0.0, large->few_s - kFew * iteration_s) / large->voxels;
  // bytes = voxel_bytes voxels + pixel_bytes pixels, for both cubes
  const double det = small->voxels * large->pixels - large->voxels * small->pixels;
  out.voxel_bytes = (small->bytes * large->pixels - large->bytes * small->pixels) / det;
  out.pixel_bytes = (small->voxels * large->bytes - large->voxels * small->bytes) / det;
  if (!(out.pixel_bytes > 0) || !(out.voxel_bytes > 0)) {  // one of them drowns in the other
    out.voxel_bytes = large->bytes / large->voxels;
    out.pixel_bytes = 0;
  }
  out.source = concat("measured here: ", recipe.solver, " with ", views, " views on ", kSmallSide, "^3 and ",
                      kLargeSide, "^3 voxels, one core");
  return out;
}

}  // namespace flamefield
