#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "reconstruct/evolutionary/archipelago.h"
#include "reconstruct/evolutionary/brood.h"
#include "reconstruct/evolutionary/ert.h"
#include "reconstruct/evolutionary/model.h"
#include "reconstruct/monitor.h"

namespace flamefield {

// The brood scheme: broods on grids from coarse to fine, each beginning with the best field of the one
// before; masks of both stages; renderings anew; history and checkpoints.
class Evolution {
 public:
  // scale: what a voxel value of 1 stands for in the problem.
  Evolution(const Problem& problem, const ErtOptions& options, const MeasurementModel& model, float scale);

  bool is_dark() const { return active_.front() == 0; }  // no voxel is lit in all views

  // Begins with this field on the finest grid, (nz, ny, nx) in [0, 1], instead of a dark one on the coarsest.
  void begin_with(std::vector<float> field);

  // Until converged or ended from outside. stop_at: ends for good at this many generations; 0: never.
  StopReason run(Monitor& monitor);

  std::vector<float> best() const;  // on the finest grid, (nz, ny, nx) in [0, 1]
  int generation() const { return generation_; }
  double z() const;
  double offspring() const;
  std::vector<std::string> notes() const;

  Result<> resume(std::string_view bytes);
  std::string checkpoint() const;

 private:
  void enter(std::size_t rung, std::vector<float> field);
  void draw_mask();
  void render_anew();
  bool rung_is_done();
  int render_every() const;
  bool ends_rung_early() const;
  void report(Monitor& monitor);
  std::vector<float> residual_of(std::vector<float> field) const;
  std::vector<float> to_finest(std::vector<float> field) const;

  const Problem& problem_;
  const ErtOptions& options_;
  const MeasurementModel& model_;
  float scale_;
  Archipelago archipelago_;
  // Index 0 is the finest.
  std::vector<StripTable> tables_;
  std::vector<Interpolation> interpolations_;
  std::vector<std::vector<float>> densities_;
  std::vector<std::size_t> active_;  // voxels that may be lit
  std::vector<double> spans_;        // offspring between looks at the progress
  double roughness_weight_ = 0;
  std::size_t rung_ = 0;
  std::optional<Brood> brood_;
  int generation_ = 0, entered_ = 0;
  double next_look_ = 0, last_objective_ = 0, made_before_ = 0;
  bool use_gradient_ = false;
  Tallies tallies_before_ = {}, tallies_reported_ = {};
};

}  // namespace flamefield
