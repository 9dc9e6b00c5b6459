#pragma once

#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "proto/error.h"

namespace flamefield {

// How many offspring a second the evolutionary solver makes and judges.
struct ErtRate {
  std::string scheme;
  int views = 0;
  double offspring = 0;
  double seconds = 0;  // wall, without what is set up once
  double cpu_s = 0;
  double per_s() const { return seconds > 0 ? offspring / seconds : 0; }
};
struct ErtBenchOptions {
  int nx = 52, ny = 55, nz = 52;  // images of nx x ny pixels
  int views = 15;
  double seconds = 8;  // of each measurement
  int threads = 2;
};

// A stratified flame by the default scheme, with half, all and twice the views; by the paper's scheme with
// images that follow from the parents'; and by the paper's scheme with every offspring rendered by the
// trilinear ray tracer (Eq. 1), which is what the paper did.
Result<std::vector<ErtRate>> measure_ert(const ErtBenchOptions& options, std::stop_token stop,
                                         const std::function<void(const std::string&)>& progress);

}  // namespace flamefield
