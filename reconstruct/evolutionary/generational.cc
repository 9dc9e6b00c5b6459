#include "reconstruct/evolutionary/generational.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/evolutionary/checkpoint.h"
#include "reconstruct/evolutionary/fitness.h"
#include "reconstruct/evolutionary/population.h"
#include "reconstruct/evolutionary/state_bytes.h"
#include "reconstruct/monitor.h"

namespace flamefield {

namespace {

// The mask without voxels outside the support; none left means that nothing may be lit.
Mask within_support(const Problem& problem, Mask mask) {
  if (problem.support.empty()) return mask;
  const Layout& layout = problem.projector.layout();
  const auto nx = static_cast<std::uint32_t>(layout.nx), ny = static_cast<std::uint32_t>(layout.ny);
  std::erase_if(mask, [&](std::uint32_t v) {
    return !problem.support[layout.voxel(static_cast<int>(v % nx), static_cast<int>(v / nx % ny),
                                         static_cast<int>(v / nx / ny))];
  });
  return mask;
}

enum Purpose : std::uint64_t { kMaskStream = 1, kOffspringStream = 2 };
constexpr int kReportEvery = 500;

// Algorithm 1, and what it has come to.
class Generations {
 public:
  Generations(const Problem& problem, const ErtOptions& options, const MeasurementModel& model, float scale)
      : problem_(problem),
        options_(options),
        scale_(scale),
        mask_stream_(problem.control.seed, std::uint64_t{kMaskStream} << 56),
        population_(problem, options, model, scale),
        mask_(within_support(
            problem, mask_from_images(problem.projector, population_.measured(),
                                      static_cast<std::size_t>(options.mask_samples), mask_stream_))) {}

  bool is_dark() const { return mask_.empty(); }
  StopReason run(Monitor& monitor);
  int generation() const { return generation_; }
  const Population& population() const { return population_; }

  std::string save() const;
  Result<> resume(std::string_view bytes);

 private:
  void evolve_once();
  void draw_mask();

  const Problem& problem_;
  const ErtOptions& options_;
  float scale_;
  Stream mask_stream_;
  Population population_;
  Mask mask_;
  int generation_ = 0;
  bool use_gradient_ = false;
};

// Stage two: the best field and the length of its gradient by turns (Algorithm 4).
void Generations::draw_mask() {
  const std::vector<float> best = population_.best_field();
  Mask drawn = within_support(
      problem_, mask_from_field(use_gradient_ ? gradient_magnitude(best, problem_.projector.grid()) : best,
                                static_cast<std::size_t>(options_.mask_samples), mask_stream_));
  if (!drawn.empty()) mask_ = std::move(drawn);
  use_gradient_ = !use_gradient_;
}

void Generations::evolve_once() {
  ++generation_;
  const double excess = options_.sigma_start > 0 ? options_.sigma_start - options_.sigma : 0;
  const double sigma = options_.sigma + excess * std::exp(-generation_ / options_.sigma_generations);
  population_.evolve(mask_, sigma, problem_.control.seed,
                     std::uint64_t{kOffspringStream} << 56 | static_cast<std::uint64_t>(generation_) << 16);
  if (generation_ % options_.render_every == 0) population_.render_anew();
  if (generation_ > options_.ma_start && generation_ % options_.steps == 0) draw_mask();
}

StopReason Generations::run(Monitor& monitor) {
  Punctual punctual(problem_.control);
  for (;;) {
    evolve_once();
    const double fitness = 1 - population_.best().z;
    std::optional<StopReason> reason = monitor.interrupted();
    if (generation_ >= options_.max_generations) reason = StopReason::Iterations;
    if (fitness >= options_.fit_threshold) reason = StopReason::Fitness;
    if (reason || generation_ % kReportEvery == 0)
      monitor.after(generation_, relative_distance(population_.best().images, population_.measured()),
                    fitness);
    if (reason) {
      if (problem_.control.checkpoint) problem_.control.checkpoint(save());
      return *reason;
    }
    punctual.after_generation(
        monitor.elapsed_s(), problem_.projector.grid(),
        [&] { return scaled(population_.best_field(), scale_ * problem_.brightness); },
        [&] { return save(); });
  }
}

std::string Generations::save() const {
  StateWriter out;
  out.put(checkpoint_identity(problem_, options_, scale_));
  out.put(generation_);
  out.put(use_gradient_);
  out.put(mask_stream_);
  out.put(mask_);
  out.put(population_.save());
  return out.bytes();
}

Result<> Generations::resume(std::string_view bytes) {
  StateReader in(bytes);
  std::string name, population;
  if (!in.get(name) || name != checkpoint_identity(problem_, options_, scale_))
    return checkpoint_refused(kOtherProblem);
  if (!in.get(generation_) || !in.get(use_gradient_) || !in.get(mask_stream_) || !in.get(mask_) ||
      !in.get(population) || !in.at_end() || !population_.load(population))
    return checkpoint_refused(kDamaged);
  const std::size_t voxels = problem_.projector.grid().voxels();
  if (mask_.empty() || std::ranges::any_of(mask_, [&](std::uint32_t v) { return v >= voxels; }))
    return checkpoint_refused(kDamaged);
  return {};
}

}  // namespace

Result<Solution> evolve_generations(const Problem& problem, const ErtOptions& options,
                                    const MeasurementModel& model, float scale) {
  Monitor monitor(problem.control, options.max_generations);
  Solution out;
  const Layout& layout = problem.projector.layout();
  out.volume.assign(layout.voxels(), 0);
  Generations generations(problem, options, model, scale);
  if (generations.is_dark()) return out;
  if (!problem.control.resume.empty()) {
    if (auto ok = generations.resume(problem.control.resume); !ok) return tl::unexpected(ok.error());
  }
  out.stop_reason = generations.run(monitor);
  out.iterations = generations.generation();
  out.volume = layout.pack_volume(scaled(generations.population().best_field(), scale));
  out.offspring = static_cast<double>(out.iterations) * (options.pop_size - (options.strong_elitism ? 1 : 0));
  out.voxel_updates = generations.population().voxel_updates();
  out.history = monitor.history();
  return out;
}

}  // namespace flamefield
