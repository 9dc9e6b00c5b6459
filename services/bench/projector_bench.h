#pragma once

#include <functional>
#include <string>
#include <vector>

#include "proto/error.h"
#include "proto/volume.h"
#include "services/bench/machine_limit.h"

namespace flamefield {

// A level ring of 300 mm around a box of 52 mm in x; square pixels, the domain fills the view (paper Fig. 2).
struct ProjectorCase {
  std::string name;
  int views = 0;
  double spacing_rad = 0;
  int rows = 0, cols = 0;      // of an image
  int nx = 0, ny = 0, nz = 0;  // voxels

  double samples() const;  // of all rays at one a plane of voxels: views * rows * cols * max(nx, nz)
  double mib() const;      // of one volume
};
// A, B or C: what a flame needs today, and the sizes that CT codes are compared at.
Result<ProjectorCase> projector_case(const std::string& name);

struct ProjectorTiming {
  int threads = 0;
  int repetitions = 0;
  double forward_cpu_s = 0, forward_wall_s = 0;  // least over the repetitions
  double adjoint_cpu_s = 0, adjoint_wall_s = 0;
};

struct ProjectorMeasurement {
  std::string engine;
  double set_up_wall_s = 0;
  std::vector<ProjectorTiming> timings;  // one per number of threads asked for
  double adjoint_mismatch = 0;           // |<Ax, y> - <x, A'y>| / <Ax, y>, random x and y in [0, 1)
};

// How a pixel sees the volume: along its central ray, as samples are counted and other codes compute; over
// its area, as `reconstruct` does by default; or traced with the paper's trilinear sampling.
enum class ProjectorModel { Ray, Area, Trilinear };
std::string name_of(ProjectorModel model);
Result<ProjectorModel> projector_model(const std::string& name);

// Memory: one volume and two sets of images beside what the projector keeps. `progress` hears what is
// measured next.
Result<ProjectorMeasurement> measure_projector(const ProjectorCase& what, ProjectorModel model,
                                               const std::vector<int>& threads, double seconds_each,
                                               const std::function<void(const std::string&)>& progress);

}  // namespace flamefield
