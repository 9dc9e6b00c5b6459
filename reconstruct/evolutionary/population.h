#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "reconstruct/evolutionary/chromosome.h"
#include "reconstruct/evolutionary/ert.h"
#include "reconstruct/evolutionary/mask.h"
#include "reconstruct/evolutionary/model.h"

namespace flamefield {

// The chromosomes of one generation, all zero at first.
class Population {
 public:
  Population(const Problem& problem, const ErtOptions& options, const MeasurementModel& model,
             float voxel_scale);

  // One evolution step (Algorithm 2) with evaluation. Offspring i takes its random numbers from stream
  // `first_stream` + i, so that it does not matter which thread makes it.
  void evolve(const Mask& mask, double sigma, std::uint64_t seed, std::uint64_t first_stream);

  // Renders the best chromosome and derives all images from that; returns how far off its images were,
  // |incremental - rendered| / |rendered|.
  double render_anew();

  const Chromosome& best() const { return members_[best_]; }
  std::vector<float> best_field() const { return field_of(best(), base_); }
  const std::vector<Chromosome>& members() const { return members_; }
  std::vector<float> field(std::size_t member) const { return field_of(members_[member], base_); }
  const std::vector<float>& measured() const { return measured_; }
  double voxel_updates() const { return voxel_updates_; }

  // All of it, for a population of the same problem and options; load() returns false for anything else.
  std::string save() const;
  bool load(std::string_view bytes);

 private:
  void make_offspring(std::size_t i, const Mask& mask, double sigma, Stream stream);
  void render(Chromosome& chromosome, Team& team) const;
  // The sum of columns is what a linear model renders; of others every offspring is rendered.
  bool is_incremental() const { return options_.incremental && model_.is_linear(); }

  const Problem& problem_;
  const ErtOptions& options_;
  const MeasurementModel& model_;
  float voxel_scale_;
  ColumnTable columns_;
  std::vector<float> measured_;  // b, (views, rows, cols): evolution works on unpacked arrays
  std::vector<float> base_;      // the field of the best
  std::vector<Chromosome> members_, offspring_;
  std::vector<double> relative_;
  std::size_t best_ = 0;
  double voxel_updates_ = 0;
};

}  // namespace flamefield
