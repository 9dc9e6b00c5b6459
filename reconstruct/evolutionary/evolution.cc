#include "reconstruct/evolutionary/evolution.h"

#include <algorithm>
#include <cmath>

#include "proto/check.h"
#include "reconstruct/evolutionary/checkpoint.h"
#include "reconstruct/evolutionary/state_bytes.h"
#include "reconstruct/noise_model.h"

namespace flamefield {

namespace {

enum Purpose : std::uint64_t { kMaskStream = 1, kOffspringStream = 2 };
constexpr std::uint64_t stream_of(Purpose purpose, int generation) {
  return std::uint64_t{purpose} << 56 | static_cast<std::uint64_t>(generation) << 20;
}

constexpr double kLookEvery = 8;         // offspring per voxel
constexpr double kModelEvery = 2;        // likewise, between renderings of a non-linear model
constexpr double kMostModelLooks = 100;  // of a non-linear model, which may circle around its solution
constexpr int kFirstReport = 10;         // generations
constexpr double kReportGrowth = 0.05;   // of the generations between reports
// A penalty for L_p whose slope matches that of p = 2 where the residual is 4 % of the brightest pixel.
constexpr double kMatchedResidual = 0.04;
// What voxels cannot model even without noise, rms, share of the brightest pixel; the weight of roughness was
// found there and grows with the noise.
constexpr double kModelError = 0.004;
constexpr float kMaskFloor = 0.02f;  // of stage two, share of the largest: no lit voxel is out of reach

double weight_of(const Problem& problem, const ErtOptions& options) {
  const double noise = problem.noise.is_known() ? std::sqrt(problem.noise.variance(0.5))
                                                : noise_level(problem.images, problem.projector.layout());
  return options.roughness * std::hypot(noise, kModelError) / kModelError * 0.5 * options.lp *
         std::pow(kMatchedResidual, options.lp - 2);
}

// Pixels that look at a voxel: the mean column sum over the voxel's side.
double pixels_per_voxel(const StripTable& table, const std::vector<float>& density, double side) {
  double sum = 0, voxels = 0;
  std::vector<Strip> scratch;
  for (std::size_t j = 0; j < density.size(); ++j) {
    if (!(density[j] > 0)) continue;
    for (const Strip& strip : table.of(j, scratch))
      for (const float w : strip.weight) sum += static_cast<double>(w);
    ++voxels;
  }
  return voxels > 0 ? sum / voxels / side : 1;
}

}  // namespace

Evolution::Evolution(const Problem& problem, const ErtOptions& options, const MeasurementModel& model,
                     float scale)
    : problem_(problem),
      options_(options),
      model_(model),
      scale_(scale),
      archipelago_(problem.control.ranks, options.migrate_every) {
  const Grid& grid = problem.projector.grid();
  const Layout& layout = problem.projector.layout();
  const auto levels = static_cast<std::size_t>(options.levels);
  tables_.reserve(levels);
  interpolations_.reserve(levels);
  tables_.emplace_back(problem.projector, scale, options.columns_budget_mib, problem.team);
  densities_.push_back(consensus_density(tables_[0], layout, problem.images, problem.team));
  if (!problem.support.empty()) {
    const std::vector<float> allowed(problem.support.begin(), problem.support.end());
    const std::vector<float> support = layout.unpack_volume(allowed);
    for (std::size_t j = 0; j < support.size(); ++j)
      if (support[j] == 0) densities_[0][j] = 0;
  }
  constexpr int kSmallest = 6;  // voxels along a side of a coarse grid
  for (std::size_t l = 1; l < levels; ++l) {
    const Grid& finer = l == 1 ? grid : interpolations_.back().coarse();
    if (std::min({finer.nx, finer.ny, finer.nz}) < 2 * kSmallest) break;
    interpolations_.emplace_back(finer);
    densities_.push_back(interpolations_.back().largest_within(densities_.back()));
    tables_.emplace_back(tables_.back(), interpolations_.back(), densities_.back(), problem.team);
  }
  for (const std::vector<float>& density : densities_) {
    active_.push_back(
        static_cast<std::size_t>(std::ranges::count_if(density, [](float d) { return d > 0; })));
    spans_.push_back(kLookEvery * static_cast<double>(active_.back()));
  }
  const double side = grid.spacing_mm.minCoeff() * static_cast<double>(scale);
  roughness_weight_ = weight_of(problem, options) * pixels_per_voxel(tables_[0], densities_[0], side);
}

std::vector<float> Evolution::to_finest(std::vector<float> field) const {
  for (std::size_t l = rung_; l > 0; --l) field = interpolations_[l - 1].prolong(field);
  return field;
}

std::vector<float> Evolution::best() const {
  return brood_ ? to_finest(brood_->field()) : std::vector<float>(problem_.projector.grid().voxels(), 0);
}

std::vector<float> Evolution::residual_of(std::vector<float> field) const {
  const Layout& layout = problem_.projector.layout();
  std::vector<float> volume = layout.pack_volume(to_finest(std::move(field))), images(layout.pixels());
  for (float& v : volume) v *= scale_;
  model_.render(problem_.team, volume, images);
  for (std::size_t i = 0; i < images.size(); ++i) images[i] = problem_.images[i] - images[i];
  images.resize(tables_[0].image_floats(), 0);
  return images;
}

void Evolution::enter(std::size_t rung, std::vector<float> field) {
  if (brood_) made_before_ += brood_->made();
  if (brood_)
    for (std::size_t i = 0; i < kOperators; ++i) {
      tallies_before_[i].made += brood_->tallies()[i].made;
      tallies_before_[i].better += brood_->tallies()[i].better;
      tallies_before_[i].gain += brood_->tallies()[i].gain;
    }
  rung_ = rung;
  entered_ = generation_;
  const std::vector<float>& density = densities_[rung];
  for (std::size_t j = 0; j < field.size(); ++j)
    if (!(density[j] > 0)) field[j] = 0;
  Habitat habitat;
  habitat.grid = rung == 0 ? problem_.projector.grid() : interpolations_[rung - 1].coarse();
  habitat.strips = &tables_[rung];
  habitat.roughness = {habitat.grid,
                       static_cast<float>(problem_.projector.grid().spacing_mm.minCoeff()) * scale_,
                       static_cast<float>(options_.roughness_edge)};
  habitat.roughness_weight = roughness_weight_ * std::exp2(static_cast<double>(rung));
  habitat.density = density;
  brood_.emplace(habitat, options_, problem_.team);
  std::vector<float> residual = residual_of(field);
  brood_->begin(std::move(field), std::move(residual));
  archipelago_.settle(*brood_);
  draw_mask();
  last_objective_ = brood_->objective();
  next_look_ = spans_[rung];
  tallies_reported_ = {};
}

void Evolution::begin_with(std::vector<float> field) {
  enter(0, std::move(field));
}

// Stage one until `ma_start`; then the best field and the length of its gradient by turns (Algorithm 4).
void Evolution::draw_mask() {
  const std::vector<float>& density = densities_[rung_];
  Stream stream(problem_.control.seed, stream_of(kMaskStream, generation_));
  const auto samples = static_cast<std::size_t>(options_.mask_samples);
  std::vector<float> target = density;
  if (generation_ > options_.ma_start) {
    const Grid grid = rung_ == 0 ? problem_.projector.grid() : interpolations_[rung_ - 1].coarse();
    target = use_gradient_ ? gradient_magnitude(brood_->field(), grid) : brood_->field();
    use_gradient_ = !use_gradient_;
    const float floor = kMaskFloor * std::max(1e-6f, *std::ranges::max_element(target));
    for (std::size_t j = 0; j < target.size(); ++j) target[j] = density[j] > 0 ? target[j] + floor : 0;
  }
  Mask mask = mask_from_field(target, samples, stream);
  std::erase_if(mask, [&](std::uint32_t v) { return !(density[v] > 0); });  // before the chain arrived
  if (mask.empty()) {
    for (std::size_t j = 0; j < density.size(); ++j)
      if (density[j] > 0) mask.push_back(static_cast<std::uint32_t>(j));
  }
  brood_->set_mask(std::move(mask));
}

void Evolution::render_anew() {
  brood_->set_residual(residual_of(brood_->field()));
}

// Generations between renderings; the same after a resumption.
int Evolution::render_every() const {
  if (model_.is_linear()) return options_.render_every;
  const double offspring = kModelEvery * static_cast<double>(active_[rung_]);
  return std::max(1, static_cast<int>(offspring / options_.pop_size));
}

bool Evolution::ends_rung_early() const {
  constexpr int kShare = 6;  // of all generations, that a coarse grid may take
  return generation_ - entered_ >= options_.max_generations / kShare ||
         archipelago_.islands() * brood_->made() >=
             options_.coarse_effort * static_cast<double>(active_[rung_]);
}

// Looks at the progress every few offspring per voxel.
bool Evolution::rung_is_done() {
  if (rung_ > 0 && ends_rung_early()) return true;
  const double made = archipelago_.islands() * brood_->made();
  if (made < next_look_) return false;
  next_look_ += spans_[rung_];
  if (!model_.is_linear()) render_anew();
  const double change = last_objective_ - brood_->objective();
  last_objective_ = brood_->objective();
  // Where the model bends, steps along its columns go too far or not far enough, and back again.
  if (!model_.is_linear() && rung_ == 0)
    return std::abs(change) < options_.tolerance * last_objective_ || made > kMostModelLooks * spans_[0];
  constexpr double kCoarser = 10;  // tolerance of a field that is only passed on
  return change < options_.tolerance * (rung_ > 0 ? kCoarser : 1) * last_objective_;
}

double Evolution::z() const {
  const Layout& layout = problem_.projector.layout();
  const double pixels = static_cast<double>(layout.views) * layout.rows * layout.cols;
  return std::pow(brood_->misfit() / pixels, 1 / options_.lp);
}

double Evolution::offspring() const {
  return archipelago_.islands() * (made_before_ + (brood_ ? brood_->made() : 0));
}

void Evolution::report(Monitor& monitor) {
  double square = 0, norm = 0;
  for (const float r : brood_->residual()) square += static_cast<double>(r) * static_cast<double>(r);
  for (const float b : problem_.images) norm += static_cast<double>(b) * static_cast<double>(b);
  std::array<float, kOperators> success = {};
  for (std::size_t i = 0; i < kOperators; ++i) {
    const Tally &now = brood_->tallies()[i], &before = tallies_reported_[i];
    if (now.made > before.made)
      success[i] = static_cast<float>((now.better - before.better) / (now.made - before.made));
  }
  tallies_reported_ = brood_->tallies();
  monitor.after(generation_, norm > 0 ? std::sqrt(square / norm) : 0, 1 - z(), success);
}

StopReason Evolution::run(Monitor& monitor) {
  if (!brood_) {
    const std::size_t top = tables_.size() - 1;
    enter(top, std::vector<float>(tables_[top].voxels(), 0));
  }
  const SolveControl& control = problem_.control;
  int next_report = generation_ + kFirstReport;
  Punctual punctual(control);
  for (;;) {
    brood_->evolve(archipelago_.seed(control.seed), stream_of(kOffspringStream, generation_));
    ++generation_;
    if (generation_ % render_every() == 0) render_anew();
    if (generation_ > options_.ma_start && generation_ % options_.steps == 0) draw_mask();
    if (!archipelago_.meets(generation_)) continue;
    archipelago_.migrate(*brood_);
    std::optional<StopReason> reason = monitor.interrupted();
    if (generation_ >= options_.max_generations) reason = StopReason::Iterations;
    if (options_.fit_threshold < 1 && archipelago_.agree(1 - z() >= options_.fit_threshold))
      reason = StopReason::Fitness;
    if (archipelago_.agree(rung_is_done())) {
      if (rung_ == 0) {
        reason = StopReason::Converged;
      } else {
        enter(rung_ - 1, interpolations_[rung_ - 1].prolong(brood_->field()));
      }
    }
    if (reason || generation_ >= next_report) {
      report(monitor);
      next_report = generation_ + std::max(kFirstReport, static_cast<int>(kReportGrowth * generation_));
    }
    if (reason) {
      if (control.checkpoint) control.checkpoint(checkpoint());
      return *reason;
    }
    punctual.after_generation(
        monitor.elapsed_s(), problem_.projector.grid(),
        [&] { return scaled(best(), scale_ * problem_.brightness); }, [&] { return checkpoint(); });
  }
}

std::vector<std::string> Evolution::notes() const {
  std::vector<std::string> out;
  out.push_back(concat(offspring(), " offspring; roughness weight ", roughness_weight_, " on ",
                       active_.front(), " voxels that all views see lit"));
  std::string line = "operators, better / made:";
  for (std::size_t i = 0; i < kOperators; ++i) {
    const Tally now = brood_ ? brood_->tallies()[i] : Tally();
    line += concat(i ? ", " : " ", name_of(static_cast<Operator>(i)), " ",
                   tallies_before_[i].better + now.better, " / ", tallies_before_[i].made + now.made);
  }
  out.push_back(std::move(line));
  return out;
}

std::string Evolution::checkpoint() const {
  StateWriter out;
  out.put(checkpoint_identity(problem_, options_, scale_));
  out.put(rung_);
  out.put(generation_);
  out.put(entered_);
  out.put(next_look_);
  out.put(last_objective_);
  out.put(made_before_);
  out.put(use_gradient_);
  out.put(tallies_before_);
  out.put(brood_->save());
  return out.bytes();
}

Result<> Evolution::resume(std::string_view bytes) {
  StateReader in(bytes);
  std::string name, brood;
  std::size_t rung = 0;
  if (!in.get(name) || name != checkpoint_identity(problem_, options_, scale_))
    return checkpoint_refused(kOtherProblem);
  if (!in.get(rung) || rung >= tables_.size()) return checkpoint_refused(kDamaged);
  enter(rung, std::vector<float>(tables_[rung].voxels(), 0));
  made_before_ = 0;
  tallies_before_ = {};
  if (!in.get(generation_) || !in.get(entered_) || !in.get(next_look_) || !in.get(last_objective_) ||
      !in.get(made_before_) || !in.get(use_gradient_) || !in.get(tallies_before_) || !in.get(brood) ||
      !in.at_end() || !brood_->load(brood))
    return checkpoint_refused(kDamaged);
  return {};
}

}  // namespace flamefield
