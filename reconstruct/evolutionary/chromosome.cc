#include "reconstruct/evolutionary/chromosome.h"

#include <cmath>

namespace flamefield {

namespace {

// Differences below this are forgotten: averaging halves them for ever, and their effect on the images (a
// hundredth of a pixel's rounding) is removed when the elite is rendered anew.
constexpr float kForgotten = 2.4e-7f;

// Walks the union of two gene lists in order: visit(voxel, value in a, value in b).
template <class Visit>
void walk_union(const std::vector<Gene>& a, const std::vector<Gene>& b, std::span<const float> base,
                const Visit& visit) {
  auto i = a.begin(), j = b.begin();
  while (i != a.end() || j != b.end()) {
    if (j == b.end() || (i != a.end() && i->voxel < j->voxel)) {
      visit(i->voxel, i->value, base[i->voxel]);
      ++i;
    } else if (i == a.end() || j->voxel < i->voxel) {
      visit(j->voxel, base[j->voxel], j->value);
      ++j;
    } else {
      visit(i->voxel, i->value, j->value);
      ++i, ++j;
    }
  }
}

}  // namespace

float Editor::value(std::size_t voxel) const {
  const auto gene = std::ranges::lower_bound(edited_.genes, voxel, {}, &Gene::voxel);
  return gene != edited_.genes.end() && gene->voxel == voxel ? gene->value : base_[voxel];
}

void Editor::set(std::size_t voxel, float value) {
  const auto gene = std::ranges::lower_bound(edited_.genes, voxel, {}, &Gene::voxel);
  const bool known = gene != edited_.genes.end() && gene->voxel == voxel;
  const float change = value - (known ? gene->value : base_[voxel]);
  if (change == 0) return;
  if (known) {
    gene->value = value;
  } else {
    edited_.genes.insert(gene, {static_cast<std::uint32_t>(voxel), value});
  }
  if (!update_images_) return;
  for (const ColumnEntry& entry : columns_.of(voxel, column_))
    edited_.images[entry.pixel] += change * scale_ * entry.weight;
}

void average(const Chromosome& mother, const Chromosome& father, std::span<const float> base,
             Chromosome& offspring) {
  offspring.z = mother.z;
  if (&mother == &father) {
    offspring.genes = mother.genes;
    offspring.images = mother.images;
    return;
  }
  offspring.genes.clear();
  walk_union(mother.genes, father.genes, base, [&](std::uint32_t voxel, float a, float b) {
    const float mean = 0.5f * (a + b);
    if (std::abs(mean - base[voxel]) > kForgotten) offspring.genes.push_back({voxel, mean});
  });
  offspring.images.resize(mother.images.size());
  const float *a = mother.images.data(), *b = father.images.data();
  float* out = offspring.images.data();
  for (std::size_t i = 0; i < mother.images.size(); ++i) out[i] = 0.5f * (a[i] + b[i]);
}

std::vector<float> field_of(const Chromosome& chromosome, std::span<const float> base) {
  std::vector<float> out(base.begin(), base.end());
  for (const Gene& gene : chromosome.genes) out[gene.voxel] = gene.value;
  return out;
}

void rebase(std::vector<Chromosome>& population, std::size_t best, std::vector<float>& base) {
  const std::vector<Gene> moved = population[best].genes;
  if (moved.empty()) return;
  for (std::size_t i = 0; i < population.size(); ++i) {
    if (i == best) continue;
    std::vector<Gene> genes;
    walk_union(population[i].genes, moved, base, [&](std::uint32_t voxel, float own, float of_best) {
      if (std::abs(own - of_best) > kForgotten) genes.push_back({voxel, own});
    });
    population[i].genes = std::move(genes);
  }
  for (const Gene& gene : moved) base[gene.voxel] = gene.value;
  population[best].genes.clear();
}

}  // namespace flamefield
