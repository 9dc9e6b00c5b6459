#include "reconstruct/evolutionary/archipelago.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <map>

#include "proto/check.h"
#include "reconstruct/share.h"

namespace flamefield {

namespace {

// One island's news: its objective, then what it added to voxels.
struct News {
  double objective = 0;
  std::vector<Gene> steps;  // value: the change
};

std::vector<std::byte> bytes_of(const News& news) {
  std::vector<std::byte> out(sizeof news.objective + news.steps.size() * sizeof(Gene));
  std::memcpy(out.data(), &news.objective, sizeof news.objective);
  if (!news.steps.empty())
    std::memcpy(out.data() + sizeof news.objective, news.steps.data(), news.steps.size() * sizeof(Gene));
  return out;
}

News news_of(const std::vector<std::byte>& bytes) {
  News out;
  expect(bytes.size() >= sizeof out.objective, "an island tells its objective");
  std::memcpy(&out.objective, bytes.data(), sizeof out.objective);
  out.steps.resize((bytes.size() - sizeof out.objective) / sizeof(Gene));
  if (!out.steps.empty())
    std::memcpy(out.steps.data(), bytes.data() + sizeof out.objective, out.steps.size() * sizeof(Gene));
  return out;
}

}  // namespace

Archipelago::Archipelago(Ranks* ranks, int generations)
    : ranks_(ranks && ranks->count() > 1 ? ranks : nullptr), generations_(generations) {}

std::uint64_t Archipelago::seed(std::uint64_t first) const {
  constexpr std::uint64_t kApart = 0x9e3779b97f4a7c15;
  return ranks_ ? first + kApart * static_cast<std::uint64_t>(ranks_->rank()) : first;
}

bool Archipelago::agree(bool value) const {
  return flamefield::agree(ranks_, value);
}

void Archipelago::settle(Brood& brood) const {
  if (ranks_) brood.remember();
}

void Archipelago::migrate(Brood& brood) const {
  if (!ranks_) return;
  struct Place {
    float original = 0;
    double sum = 0, best = 0;  // of the changes: all, and those of the best island
  };
  std::map<std::uint32_t, Place> places;
  News own{brood.objective(), brood.take_originals()};
  for (Gene& gene : own.steps) {
    places[gene.voxel].original = gene.value;
    gene.value = brood.field()[gene.voxel] - gene.value;
  }
  std::vector<News> all;
  for (const auto& bytes : ranks_->gather(bytes_of(own))) all.push_back(news_of(bytes));
  const auto best = std::ranges::min_element(all, {}, &News::objective);
  for (const News& news : all)
    for (const Gene& step : news.steps) {
      const auto [at, is_new] = places.try_emplace(step.voxel);
      if (is_new) at->second.original = brood.field()[step.voxel];
      at->second.sum += static_cast<double>(step.value);
      if (&news == &*best) at->second.best += static_cast<double>(step.value);
    }
  const auto adopt = [&](double Place::*change) {
    std::vector<Gene> genes;
    for (const auto& [voxel, place] : places) {
      const auto value = static_cast<float>(static_cast<double>(place.original) + place.*change);
      genes.push_back({voxel, std::clamp(value, 0.0f, 1.0f)});
    }
    brood.adopt(genes);
  };
  adopt(&Place::sum);
  if (!agree(brood.objective() <= best->objective)) adopt(&Place::best);
}

}  // namespace flamefield
