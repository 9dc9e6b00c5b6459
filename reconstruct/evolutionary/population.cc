#include "reconstruct/evolutionary/population.h"

#include <algorithm>

#include "reconstruct/evolutionary/fitness.h"
#include "reconstruct/evolutionary/operators.h"
#include "reconstruct/evolutionary/state_bytes.h"

namespace flamefield {

Population::Population(const Problem& problem, const ErtOptions& options, const MeasurementModel& model,
                       float voxel_scale)
    : problem_(problem),
      options_(options),
      model_(model),
      voxel_scale_(voxel_scale),
      columns_(problem.projector, options.columns_budget_mib, problem.team),
      measured_(problem.projector.layout().unpack_images(problem.images)),
      base_(problem.projector.grid().voxels(), 0) {
  Chromosome dark;
  dark.images.assign(measured_.size(), 0);
  dark.z = distance_z(measured_, dark.images, options.lp);
  members_.assign(static_cast<std::size_t>(options.pop_size), dark);
  offspring_ = members_;
  relative_.assign(members_.size(), 1);
}

void Population::render(Chromosome& chromosome, Team& team) const {
  const Layout& layout = problem_.projector.layout();
  std::vector<float> field = layout.pack_volume(field_of(chromosome, base_)), images(layout.pixels());
  for (float& v : field) v *= voxel_scale_;
  model_.render(team, field, images);
  chromosome.images = layout.unpack_images(images);
}

void Population::make_offspring(std::size_t i, const Mask& mask, double sigma, Stream stream) {
  Chromosome& child = offspring_[i];
  const std::size_t mother = options_.weak_elitism ? best_ : roulette(relative_, stream);
  const std::size_t father =
      options_.weak_elitism ? stream.below(members_.size()) : roulette(relative_, stream);
  average(members_[mother], members_[father], base_, child);
  Editor editor(columns_, voxel_scale_, base_, child, is_incremental());
  const double r1 = stream.uniform(), r2 = stream.uniform(), r3 = stream.uniform();
  if (r1 < options_.mutation_rate) mutate(editor, mask, options_.mutation_intensity, sigma, stream);
  if (r2 < options_.annihilation_rate) annihilate(editor, mask, options_.annihilation_intensity, stream);
  if (r3 < options_.filter_rate) filter(editor, mask, options_.filter_intensity, stream);
  if (!is_incremental()) {
    Team alone(1);
    render(child, alone);
  }
  child.z = distance_z(measured_, child.images, options_.lp);
}

void Population::evolve(const Mask& mask, double sigma, std::uint64_t seed, std::uint64_t first_stream) {
  const std::size_t kept = options_.strong_elitism ? 1 : 0;
  problem_.team.run(members_.size() - kept,
                    [&](std::size_t i) { make_offspring(i, mask, sigma, Stream(seed, first_stream + i)); });
  if (kept) offspring_.back() = members_[best_];  // keeps its place in memory warm: the buffers are reused
  members_.swap(offspring_);

  std::vector<double> z;
  for (const Chromosome& member : members_) z.push_back(member.z);
  best_ = static_cast<std::size_t>(std::ranges::min_element(z) - z.begin());
  relative_ = relative_fitness(z);
  voxel_updates_ += static_cast<double>(members_.size() - kept) *
                    (options_.mutation_rate * options_.mutation_intensity +
                     options_.annihilation_rate * options_.annihilation_intensity +
                     options_.filter_rate * options_.filter_intensity);
  rebase(members_, best_, base_);
}

double Population::render_anew() {
  Chromosome& best = members_[best_];
  const std::vector<float> before = best.images;
  render(best, problem_.team);
  const double drift = relative_distance(before, best.images);
  std::vector<ColumnEntry> column;
  for (std::size_t i = 0; i < members_.size(); ++i) {
    Chromosome& member = members_[i];
    if (i != best_ && is_incremental()) {
      member.images = best.images;
      for (const Gene& gene : member.genes) {
        for (const ColumnEntry& e : columns_.of(gene.voxel, column))
          member.images[e.pixel] += (gene.value - base_[gene.voxel]) * voxel_scale_ * e.weight;
      }
    }
    member.z = distance_z(measured_, member.images, options_.lp);
  }
  return drift;
}

std::string Population::save() const {
  StateWriter out;
  out.put(base_);
  out.put(relative_);
  out.put(best_);
  out.put(voxel_updates_);
  for (const Chromosome& member : members_) {
    out.put(member.genes);
    out.put(member.images);
    out.put(member.z);
  }
  return out.bytes();
}

bool Population::load(std::string_view bytes) {
  StateReader in(bytes);
  const std::size_t voxels = base_.size(), size = members_.size();
  if (!in.get(base_) || !in.get(relative_) || !in.get(best_) || !in.get(voxel_updates_)) return false;
  if (base_.size() != voxels || relative_.size() != size || best_ >= size) return false;
  for (Chromosome& member : members_) {
    if (!in.get(member.genes) || !in.get(member.images) || !in.get(member.z)) return false;
    const auto outside = [&](const Gene& gene) { return gene.voxel >= voxels; };
    if (member.images.size() != measured_.size() || std::ranges::any_of(member.genes, outside)) return false;
  }
  return in.at_end();
}

}  // namespace flamefield
