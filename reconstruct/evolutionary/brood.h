#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "reconstruct/evolutionary/chromosome.h"
#include "reconstruct/evolutionary/ert.h"
#include "reconstruct/evolutionary/mask.h"
#include "reconstruct/evolutionary/misfit.h"
#include "reconstruct/evolutionary/roughness.h"
#include "reconstruct/evolutionary/strip_table.h"
#include "reconstruct/parallel.h"
#include "reconstruct/random.h"

namespace flamefield {

// How the offspring of a brood come about. All but Creep are the paper's operators (Section 2.2).
enum class Operator : std::uint8_t { Creep, Mutation, Annihilation, Filter, Crossover };
inline constexpr std::size_t kOperators = 5;
std::string_view name_of(Operator op);

// Offspring made with an operator, those better than their best parent, and by how much.
struct Tally {
  double made = 0, better = 0, gain = 0;
};
using Tallies = std::array<Tally, kOperators>;

// What a brood lives in: a grid, the images of its voxels, what is punished beside the misfit, and where
// there may be light at all.
struct Habitat {
  Grid grid;
  const StripTable* strips = nullptr;
  Roughness roughness;
  double roughness_weight = 0;
  std::vector<float> density;  // of the mask of stage one, (nz, ny, nx); where it is 0 all stays dark
};

// One generation after another of a population that consists of a best field (the elite) and `pop_size`
// offspring, each the elite with a few voxels changed. An offspring is judged by the pixels of these voxels
// alone. Offspring that are better than the elite are joined to it, best first, as long as each improves what
// the ones before have made of it: strong elitism for many at a time. Every voxel has its own sigma, which
// grows with success and shrinks with failure; operators are chosen by what they have gained.
class Brood {
 public:
  Brood(const Habitat& habitat, const ErtOptions& options, Team& team);

  void begin(std::vector<float> field, std::vector<float> residual);
  void set_mask(Mask mask) { mask_ = std::move(mask); }

  // Offspring i draws from Stream(seed, first_stream + i), whatever the thread.
  void evolve(std::uint64_t seed, std::uint64_t first_stream);

  // Replaces the images of the elite: residual = measured - rendered.
  void set_residual(std::vector<float> residual);

  // Islands (see Archipelago): from now on the values that voxels had before they were changed are kept.
  void remember() { remembered_.assign(field_.size(), false); }
  // Voxels changed since then or since the last call, with their values of that time.
  std::vector<Gene> take_originals();
  // Sets voxels, for better or worse. Not remembered.
  void adopt(std::span<const Gene> genes);

  const std::vector<float>& field() const { return field_; }
  std::span<const float> residual() const { return residual_; }
  double objective() const {
    return objective_;
  }                       // sum |residual|^p + weighted roughness, but for a constant
  double misfit() const;  // sum |residual|^p
  const Tallies& tallies() const { return tallies_; }
  double made() const;  // offspring

  // All that decides how it goes on; load() expects what save() of an equal brood wrote.
  std::string save() const;
  bool load(std::string_view bytes);

 private:
  struct Offspring {
    Operator op = Operator::Creep;
    std::vector<Gene> genes;
    double change = 0;  // of the objective
  };

  void make(Offspring& child, Stream stream) const;
  void mutate(Offspring& child, Stream& stream, bool around_neighbours) const;
  void cross(Offspring& child, Stream& stream) const;
  Operator choose(double u) const;
  std::size_t select(Stream& stream) const;
  double judge(const Offspring& child, std::vector<float>& patch) const;
  void join_better();
  void set(const Gene& gene, std::vector<Strip>& scratch);
  void adapt();

  Habitat habitat_;
  const ErtOptions& options_;
  Team& team_;
  Misfit measure_;
  Mask mask_;
  std::vector<float> field_, residual_;  // (nz, ny, nx); packed images with Strip::kPixels to spare
  std::vector<float> sigma_;             // of each voxel
  std::vector<Offspring> offspring_, parents_;
  std::vector<double> wheel_;              // running sums of the parents' relative fitness
  std::array<double, kOperators> rates_;   // add up to 1
  std::array<double, kOperators> credit_;  // gain per offspring, fading
  Tallies tallies_;
  double objective_ = 0;
  std::vector<bool> remembered_;  // voxels whose values are in originals_; empty: none are kept
  std::vector<Gene> originals_;
  std::vector<std::vector<float>> patches_;  // of each block, all zero between uses
};

}  // namespace flamefield
