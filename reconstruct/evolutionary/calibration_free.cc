#include "reconstruct/evolutionary/calibration_free.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/render.h"

namespace flamefield {

namespace {

constexpr int kMutations = 160;  // of a view's genes in a round
constexpr double kFirstStep_px = 0.6;
constexpr double kWiden = 1.5, kNarrow = 0.9;
// Corrections are not free: this share of the misfit a squared pixel, which settles what the image leaves
// open between genes of nearly the same effect.
constexpr double kRidge = 1e-4;

double misfit(const Image& rendered, std::span<const float> image, const Layout& layout, double p) {
  double sum = 0;
  for (int row = 0; row < layout.rows; ++row)
    for (int col = 0; col < layout.cols; ++col) {
      const float d = rendered.at(col, row) - image[layout.pixel(0, row, col)];
      sum += std::pow(static_cast<double>(std::abs(d)), p);
    }
  return sum;
}

}  // namespace

Camera evolve_camera(const Camera& camera, const Volume& field, std::span<const float> image,
                     const Layout& layout, double lp, double least_step_px, Stream stream) {
  const Renderer renderer(field);
  const RenderOptions rendering{.step_voxels = 0.5, .pixel_samples = 2, .threads = 1};
  const auto cost = [&](const CameraGenes& genes) {
    double squares = 0;
    for (const double g : genes.px) squares += g * g;
    const Image rendered = renderer.view(corrected(camera, genes, field.grid), rendering);
    return misfit(rendered, image, layout, lp) * (1 + kRidge * squares);
  };
  CameraGenes best;
  double least = cost(best);
  std::array<double, CameraGenes::kCount> step;
  step.fill(kFirstStep_px);
  for (int i = 0; i < kMutations; ++i) {
    // Genes by turns, the shifts of the image twice as often.
    constexpr std::size_t kTurns[] = {CameraGenes::CentreX, CameraGenes::CentreY, CameraGenes::Roll,
                                      CameraGenes::Forward, CameraGenes::CentreX, CameraGenes::CentreY,
                                      CameraGenes::Yaw,     CameraGenes::Pitch,   CameraGenes::Right,
                                      CameraGenes::Down,    CameraGenes::Focal};
    const std::size_t gene = kTurns[static_cast<std::size_t>(i) % std::size(kTurns)];
    if (step[gene] < least_step_px) continue;
    CameraGenes child = best;
    child.px[gene] += step[gene] * stream.normal();
    const double now = cost(child);
    const bool better = now < least;
    step[gene] *= better ? kWiden : kNarrow;
    if (!better) continue;
    best = child;
    least = now;
  }
  return corrected(camera, best, field.grid);
}

Result<Solution> solve_with_cameras(const Problem& problem, const ErtOptions& options) {
  const Layout& layout = problem.projector.layout();
  const Grid& grid = problem.projector.grid();
  const std::vector<Camera>& given = problem.projector.cameras();
  Rig rig;
  rig.cameras = given;
  ErtOptions field_options = options;
  field_options.calibrate_rounds = 0;
  Monitor clock(problem.control, 1);
  Solution out;
  for (int round = 0; round <= options.calibrate_rounds; ++round) {
    const int left = options.calibrate_rounds - round;
    // Smooth first: three halvings of the weight, then as the recipe says.
    field_options.roughness = options.roughness * std::exp2(std::min(left, 4));
    field_options.tolerance = left > 0 ? std::max(options.tolerance, 2e-3) : options.tolerance;
    // Corrected cameras are not level; a stored matrix hands out their columns fastest.
    auto projector = Projector::make(rig, grid, {.trilinear = true}, problem.team);
    if (!projector) return tl::unexpected(projector.error());
    SolveControl control = problem.control;
    if (control.time_limit_s > 0)
      control.time_limit_s = std::max(0.01, (control.time_limit_s - clock.elapsed_s()) / (left > 0 ? 2 : 1));
    const Problem now{*projector, problem.images, control,      problem.team,  problem.support,
                      {},         true,           problem.stop, problem.noise, problem.brightness};
    auto solved = solve_ert(now, field_options);
    if (!solved) return solved;
    out = std::move(*solved);
    if (left == 0 || clock.interrupted()) {
      if (out.images.empty()) {
        out.images.resize(layout.pixels());
        projector->forward(problem.team, out.volume, out.images);
      }
      break;
    }
    out.images.clear();
    Volume field(grid);
    field.values = layout.unpack_volume(out.volume);
    const double least_step_px = 0.01;
    problem.team.run(rig.cameras.size(), [&](std::size_t v) {
      const auto image = problem.images.subspan(v * layout.pixels_per_view(), layout.pixels_per_view());
      const auto stream_id =
          std::uint64_t{3} << 56 | static_cast<std::uint64_t>(round) << 32 | static_cast<std::uint64_t>(v);
      rig.cameras[v] = evolve_camera(rig.cameras[v], field, image, layout, options.lp, least_step_px,
                                     Stream(problem.control.seed, stream_id));
    });
    keep_gauge(rig.cameras, given, grid);
  }
  double mean = 0;
  for (std::size_t v = 0; v < given.size(); ++v) {
    const double shift = mean_shift_px(given[v], rig.cameras[v], grid);
    mean += shift / static_cast<double>(given.size());
    out.notes.push_back(concat("camera ", given[v].name, " corrected by ", shift, " px"));
  }
  out.notes.push_back(concat("cameras corrected by ", mean, " px in the mean"));
  out.cameras = rig.cameras;
  return out;
}

}  // namespace flamefield
