#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "reconstruct/evolutionary/column_table.h"
#include "reconstruct/evolutionary/neighbours.h"

namespace flamefield {

// One voxel in which a chromosome differs from the base field of its population.
struct Gene {
  std::uint32_t voxel = 0;
  float value = 0;
};

// An individual: a field in [0, 1] and its images. Individuals of a population are nearly alike, so that each
// stores only its differences from a common base, the best one; making and changing an offspring then costs a
// few hundred operations, and its images follow from those of its parents (evaluation is O(pixels)).
struct Chromosome {
  std::vector<Gene> genes;    // ascending voxels
  std::vector<float> images;  // A x, (views, rows, cols)
  double z = 0;               // the paper's Z, 0 is perfect
};

// Reads and writes single voxels of a chromosome and keeps its images up to date: a change by d adds d times
// a column of A.
class Editor {
 public:
  // voxel_scale: what a voxel value of 1 stands for in A's volume.
  Editor(const ColumnTable& columns, float voxel_scale, std::span<const float> base, Chromosome& chromosome,
         bool update_images)
      : columns_(columns),
        scale_(voxel_scale),
        base_(base),
        edited_(chromosome),
        update_images_(update_images) {}

  const Grid& grid() const { return columns_.grid(); }
  float value(std::size_t voxel) const;
  void set(std::size_t voxel, float value);

  Neighbours neighbours(std::size_t voxel) const {
    return flamefield::neighbours(grid(), voxel, [this](std::size_t j) { return value(j); });
  }

 private:
  const ColumnTable& columns_;
  float scale_;
  std::span<const float> base_;
  Chromosome& edited_;
  bool update_images_;
  std::vector<ColumnEntry> column_;
};

// Crossover (paper, Section 2.2): the voxel-wise mean of two parents, and of their images.
void average(const Chromosome& mother, const Chromosome& father, std::span<const float> base,
             Chromosome& offspring);

// All voxels of a chromosome.
std::vector<float> field_of(const Chromosome& chromosome, std::span<const float> base);

// Makes `population[best]` the base: its genes vanish, the others' are rewritten against it.
void rebase(std::vector<Chromosome>& population, std::size_t best, std::vector<float>& base);

}  // namespace flamefield
