#include "reconstruct/evolutionary/brood.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "proto/check.h"
#include "reconstruct/evolutionary/fitness.h"
#include "reconstruct/evolutionary/state_bytes.h"

namespace flamefield {

namespace {

constexpr std::size_t kBlock = 64;  // offspring made by one thread at a time
constexpr float kSmallestSigma = 1e-4f, kLargestSigma = 0.5f;
// Success widens a voxel's mutations and failure narrows them, in balance at three successes in ten: a random
// step along one axis of a bowl succeeds half of the time while it is small.
constexpr float kWiden = 1.6f, kNarrow = 0.87f;
constexpr double kLeastRate = 0.01;  // of an operator, so that it can show what it is worth
constexpr double kFade = 0.98;       // of credit, each generation

}  // namespace

std::string_view name_of(Operator op) {
  constexpr std::array<std::string_view, kOperators> kNames = {"creep", "mutation", "annihilation", "filter",
                                                               "crossover"};
  return kNames[static_cast<std::size_t>(op)];
}

Brood::Brood(const Habitat& habitat, const ErtOptions& options, Team& team)
    : habitat_(habitat),
      options_(options),
      team_(team),
      measure_(options.lp),
      sigma_(habitat.grid.voxels(), static_cast<float>(options.sigma)),
      offspring_(static_cast<std::size_t>(options.pop_size)),
      patches_((offspring_.size() + kBlock - 1) / kBlock) {
  const std::array<double, kOperators> wanted = {options.creep_rate, options.mutation_rate,
                                                 options.annihilation_rate, options.filter_rate,
                                                 options.crossover_rate};
  const double total = std::accumulate(wanted.begin(), wanted.end(), 0.0);
  for (std::size_t i = 0; i < kOperators; ++i) rates_[i] = total > 0 ? wanted[i] / total : 1.0 / kOperators;
  credit_.fill(0);
}

void Brood::begin(std::vector<float> field, std::vector<float> residual) {
  field_ = std::move(field);
  for (std::size_t j = 0; j < field_.size(); ++j)
    expect(field_[j] == 0 || habitat_.density[j] > 0, "light only where the mask allows it");
  set_residual(std::move(residual));
}

void Brood::set_residual(std::vector<float> residual) {
  expect(residual.size() == habitat_.strips->image_floats(), "images with floats to spare");
  residual_ = std::move(residual);
  objective_ = misfit();
  if (habitat_.roughness_weight > 0)
    objective_ += habitat_.roughness_weight * total_roughness(habitat_.roughness, field_);
}

double Brood::misfit() const {
  return measure_.total(std::span(residual_).first(residual_.size() - Strip::kPixels));
}

double Brood::made() const {
  double out = 0;
  for (const Tally& tally : tallies_) out += tally.made;
  return out;
}

Operator Brood::choose(double u) const {
  for (std::size_t i = 0; i + 1 < kOperators; ++i) {
    if (u < rates_[i]) return static_cast<Operator>(i);
    u -= rates_[i];
  }
  return Operator::Crossover;
}

// Roulette over the parents' relative fitness.
std::size_t Brood::select(Stream& stream) const {
  const auto at = std::ranges::upper_bound(wheel_, stream.uniform() * wheel_.back());
  return std::min(static_cast<std::size_t>(at - wheel_.begin()), wheel_.size() - 1);
}

// Crossover with weak elitism: the voxel-wise mean of the best and of another of the last generation. A step
// that went too far is tried again at half its length.
void Brood::cross(Offspring& child, Stream& stream) const {
  if (wheel_.empty()) return;
  for (const Gene& gene : parents_[select(stream)].genes)
    child.genes.push_back({gene.voxel, 0.5f * (field_[gene.voxel] + gene.value)});
}

void Brood::mutate(Offspring& child, Stream& stream, bool around_neighbours) const {
  const std::uint32_t voxel = mask_[stream.below(mask_.size())];
  float mean = field_[voxel];
  if (around_neighbours) {
    const Neighbours near = neighbours(habitat_.grid, voxel, [&](std::size_t j) { return field_[j]; });
    mean = (mean + near.sum) / static_cast<float>(near.count + 1);
  }
  const double sigma = options_.adaptive ? static_cast<double>(sigma_[voxel]) : options_.sigma;
  child.genes.push_back(
      {voxel, static_cast<float>(stream.truncated_normal(static_cast<double>(mean), sigma))});
}

void Brood::make(Offspring& child, Stream stream) const {
  child.op = choose(stream.uniform());
  child.genes.clear();
  const auto repeat = [&](int times, const auto& body) {
    for (int i = 0; i < times; ++i) body();
  };
  switch (child.op) {
    case Operator::Creep:
      repeat(options_.mutation_intensity, [&] { mutate(child, stream, false); });
      break;
    case Operator::Mutation:
      repeat(options_.mutation_intensity, [&] { mutate(child, stream, true); });
      break;
    case Operator::Annihilation:
      repeat(options_.annihilation_intensity, [&] {
        child.genes.push_back({mask_[stream.below(mask_.size())], 0});
      });
      break;
    case Operator::Filter:
      repeat(options_.filter_intensity, [&] {
        const std::uint32_t voxel = mask_[stream.below(mask_.size())];
        const Neighbours near = neighbours(habitat_.grid, voxel, [&](std::size_t j) { return field_[j]; });
        child.genes.push_back({voxel, 0.5f * field_[voxel] + near.sum / 12});
      });
      break;
    case Operator::Crossover:
      cross(child, stream);
      break;
  }
}

// The change of the objective against the elite. Only pixels and neighbours of changed voxels are looked at;
// `patch` holds what the voxels before have added to the images.
double Brood::judge(const Offspring& child, std::vector<float>& patch) const {
  thread_local std::vector<Strip> scratch;
  const bool alone = child.genes.size() == 1;
  double change = 0;
  for (std::size_t i = 0; i < child.genes.size(); ++i) {
    const Gene& gene = child.genes[i];
    const auto value = [&](std::size_t voxel) {
      for (std::size_t k = i; k-- > 0;)
        if (child.genes[k].voxel == voxel) return child.genes[k].value;
      return field_[voxel];
    };
    const float step = gene.value - value(gene.voxel);
    if (step == 0) continue;
    const auto strips = habitat_.strips->of(gene.voxel, scratch);
    if (alone) {
      change += measure_.after(strips, step, residual_.data(), nullptr);
    } else {
      patch.resize(residual_.size(), 0);
      change += measure_.after(strips, step, residual_.data(), patch.data());
      for (const Strip& strip : strips)
        for (std::size_t k = 0; k < Strip::kPixels; ++k) patch[strip.first + k] += step * strip.weight[k];
    }
    if (habitat_.roughness_weight > 0) {
      const float rougher =
          alone ? habitat_.roughness.after(gene.voxel, step, [&](std::size_t j) { return field_[j]; })
                : habitat_.roughness.after(gene.voxel, step, value);
      change += habitat_.roughness_weight * static_cast<double>(rougher);
    }
  }
  if (!alone) {
    for (const Gene& gene : child.genes)
      for (const Strip& strip : habitat_.strips->of(gene.voxel, scratch))
        if (!patch.empty()) std::fill_n(patch.begin() + strip.first, Strip::kPixels, 0.0f);
  }
  return change;
}

void Brood::set(const Gene& gene, std::vector<Strip>& scratch) {
  const float step = gene.value - field_[gene.voxel];
  field_[gene.voxel] = gene.value;
  for (const Strip& strip : habitat_.strips->of(gene.voxel, scratch))
    for (std::size_t k = 0; k < Strip::kPixels; ++k) residual_[strip.first + k] -= step * strip.weight[k];
}

std::vector<Gene> Brood::take_originals() {
  for (const Gene& gene : originals_) remembered_[gene.voxel] = false;
  return std::exchange(originals_, {});
}

void Brood::adopt(std::span<const Gene> genes) {
  std::vector<Strip> scratch;
  for (const Gene& gene : genes) {
    const float step = gene.value - field_[gene.voxel];
    if (step == 0) continue;
    objective_ += measure_.after(habitat_.strips->of(gene.voxel, scratch), step, residual_.data(), nullptr);
    if (habitat_.roughness_weight > 0) {
      const float rougher =
          habitat_.roughness.after(gene.voxel, step, [&](std::size_t j) { return field_[j]; });
      objective_ += habitat_.roughness_weight * static_cast<double>(rougher);
    }
    set(gene, scratch);
  }
}

void Brood::join_better() {
  std::vector<std::pair<double, std::size_t>> better;
  for (std::size_t i = 0; i < offspring_.size(); ++i)
    if (offspring_[i].change < 0) better.emplace_back(offspring_[i].change, i);
  std::ranges::sort(better);
  std::vector<Strip> scratch;
  for (const auto& [alone, i] : better) {
    const Offspring& child = offspring_[i];
    const double change = i == better.front().second ? alone : judge(child, patches_.front());
    if (!(change < 0)) continue;
    for (const Gene& gene : child.genes) {
      if (!remembered_.empty() && !remembered_[gene.voxel]) {
        remembered_[gene.voxel] = true;
        originals_.push_back({gene.voxel, field_[gene.voxel]});
      }
      set(gene, scratch);
    }
    objective_ += change;
    Tally& tally = tallies_[static_cast<std::size_t>(child.op)];
    tally.gain -= change;
  }
}

void Brood::adapt() {
  Tallies now = {};
  for (const Offspring& child : offspring_) {
    Tally& tally = now[static_cast<std::size_t>(child.op)];
    const bool better = child.change < 0;
    tally.made += 1;
    tally.better += better ? 1 : 0;
    tally.gain -= better ? child.change : 0;
    if (child.op != Operator::Creep && child.op != Operator::Mutation) continue;
    for (const Gene& gene : child.genes) {
      float& sigma = sigma_[gene.voxel];
      sigma = std::clamp(sigma * (better ? kWiden : kNarrow), kSmallestSigma, kLargestSigma);
    }
  }
  double total = 0;
  for (std::size_t i = 0; i < kOperators; ++i) {
    tallies_[i].made += now[i].made;
    tallies_[i].better += now[i].better;
    if (now[i].made > 0) credit_[i] = kFade * credit_[i] + (1 - kFade) * now[i].gain / now[i].made;
    total += rates_[i] > 0 ? credit_[i] : 0;
  }
  if (!options_.adaptive || !(total > 0)) return;
  // Operators that the recipe switches off stay off.
  double sum = 0;
  for (std::size_t i = 0; i < kOperators; ++i) {
    if (rates_[i] > 0) rates_[i] = std::max(kLeastRate, kFade * rates_[i] + (1 - kFade) * credit_[i] / total);
    sum += rates_[i];
  }
  for (double& rate : rates_) rate /= sum;
}

void Brood::evolve(std::uint64_t seed, std::uint64_t first_stream) {
  expect(!mask_.empty(), "a mask was set");
  wheel_.clear();
  if (!parents_.empty()) {
    std::vector<double> z;
    for (const Offspring& parent : parents_) z.push_back(parent.change);
    wheel_ = relative_fitness(z);
    std::partial_sum(wheel_.begin(), wheel_.end(), wheel_.begin());
  }
  const std::size_t blocks = patches_.size();
  team_.run(blocks, [&](std::size_t block) {
    const std::size_t end = std::min(offspring_.size(), (block + 1) * kBlock);
    for (std::size_t i = block * kBlock; i < end; ++i) {
      make(offspring_[i], Stream(seed, first_stream + i));
      offspring_[i].change = judge(offspring_[i], patches_[block]);
    }
  });
  join_better();
  adapt();
  parents_.swap(offspring_);
  if (offspring_.size() != parents_.size()) offspring_.resize(parents_.size());
}

std::string Brood::save() const {
  StateWriter out;
  out.put(field_);
  out.put(residual_);
  out.put(sigma_);
  out.put(mask_);
  out.put(rates_);
  out.put(credit_);
  out.put(tallies_);
  out.put(objective_);
  out.put(parents_.size());
  for (const Offspring& parent : parents_) {
    out.put(parent.op);
    out.put(parent.genes);
    out.put(parent.change);
  }
  return out.bytes();
}

bool Brood::load(std::string_view bytes) {
  StateReader in(bytes);
  const std::size_t voxels = field_.size(), floats = residual_.size();
  std::size_t parents = 0;
  bool good = in.get(field_) && in.get(residual_) && in.get(sigma_) && in.get(mask_) && in.get(rates_) &&
              in.get(credit_) && in.get(tallies_) && in.get(objective_) && in.get(parents) &&
              parents <= offspring_.size();
  good = good && field_.size() == voxels && residual_.size() == floats && sigma_.size() == voxels &&
         std::ranges::all_of(mask_, [&](std::uint32_t v) { return v < voxels; });
  if (!good) return false;
  parents_.resize(parents);
  for (Offspring& parent : parents_) {
    if (!in.get(parent.op) || !in.get(parent.genes) || !in.get(parent.change)) return false;
    if (!std::ranges::all_of(parent.genes, [&](const Gene& g) { return g.voxel < voxels; })) return false;
  }
  return in.at_end();
}

}  // namespace flamefield
