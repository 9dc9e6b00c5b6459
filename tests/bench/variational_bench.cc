// What the priors cost in an iteration of the primal-dual solver, beside the projector: dual and primal steps
// of case A (52 x 55 x 52 voxels), or of a cube. usage: bench_variational [voxels_per_side, 0: case A]
// [threads] [iterations]
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>

#include "reconstruct/variational/differences.h"

using namespace flamefield;

namespace {

double cpu_ms() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto milliseconds = [](const timeval& t) {
    return 1e3 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_usec);
  };
  return milliseconds(usage.ru_utime) + milliseconds(usage.ru_stime);
}

}  // namespace

int main(int argc, char** argv) {
  const auto argument = [&](int i, int otherwise) { return argc > i ? std::stoi(argv[i]) : otherwise; };
  const int side = argument(1, 0), threads = argument(2, 2), iterations = argument(3, 200);
  const Grid grid = side > 0 ? centred_grid(side, side, side, 1) : centred_grid(52, 55, 52, 1.32);
  const Layout layout(grid, 1, 1, 1);
  const Differences differences(Share(grid), layout);
  Team team(threads);
  std::printf("%d x %d x %d voxels, %d threads, %d iterations\n", grid.nx, grid.ny, grid.nz, team.threads(),
              iterations);
  const auto measure = [&](const char* name, bool has_gradient, bool has_hessian) {
    Differences::Dual gradient = differences.make_dual(has_gradient ? Differences::kGradient : 0);
    Differences::Dual hessian = differences.make_dual(has_hessian ? Differences::kHessian : 0);
    GuardedVolume x(layout.voxels()), bar(layout.voxels()), next(layout.voxels());
    for (std::size_t i = 0; i < layout.voxels(); ++i) bar.data()[i] = static_cast<float>(i % 7);
    const std::vector<float> data(layout.voxels(), -1.0f), step(layout.voxels(), 0.01f);
    double best_ms = 1e300;
    const double before_ms = cpu_ms();
    for (int i = 0; i < iterations; ++i) {
      const auto begin = std::chrono::steady_clock::now();
      differences.iterate(
          team, bar, {gradient, {0.1f, 0.01f}}, {hessian, {0.1f, 0.01f}},
          {.h = 1, .data = data.data(), .step = step.data(), .x = x.data(), .bar = next.data()});
      std::swap(bar, next);
      const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - begin;
      best_ms = std::min(best_ms, wall.count());
    }
    std::printf("%-28s best %.3f ms wall, mean %.3f ms CPU an iteration\n", name, best_ms,
                (cpu_ms() - before_ms) / iterations);
  };
  measure("no prior", false, false);
  measure("total variation", true, false);
  measure("Hessian", false, true);
  measure("Hessian and total variation", true, true);
}
