// One large reconstruction by one rank and by all, and evolution on one island and on all, within one run:
//   mpirun -n 2 --map-by core build/release/bin/bench_mpi [slabs 256 24 6 hessian | islands 52 0.995]
// Every rank has one thread. While one works, the others sleep.
#define OMPI_SKIP_MPICXX
#include <malloc.h>
#include <mpi.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <thread>

#include "reconstruct/phantom/phantom.h"
#include "reconstruct/ring.h"
#include "reconstruct/solver.h"
#include "services/bench/stopwatch.h"
#include "services/mpi/mpi_ranks.h"

namespace flamefield {
namespace {

class Single : public Ranks {
 public:
  int rank() const override { return 0; }
  int count() const override { return 1; }
  void exchange(int, ConstBytes, int, Bytes) override {}
  void broadcast(int, Bytes) override {}
  std::vector<std::vector<std::byte>> gather(ConstBytes bytes) override {
    return {{bytes.begin(), bytes.end()}};
  }
};

double status_mib(const std::string& name) {
  std::ifstream in("/proc/self/status");
  for (std::string word; in >> word;)
    if (double kib = 0; word == name && in >> kib) return kib / 1024;
  return 0;
}

// Unlike MPI's own waiting, it leaves the core alone.
void meet() {
  MPI_Request request = MPI_REQUEST_NULL;
  MPI_Ibarrier(MPI_COMM_WORLD, &request);
  for (int done = 0; !done; MPI_Test(&request, &done, MPI_STATUS_IGNORE))
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
}

struct Outcome {
  Reconstruction result;   // without its volume, which would count in the next one's memory
  std::uint64_t bits = 0;  // FNV-1a of the volume
  double wall_s = 0, peak_mib = 0;
};

struct Scene {
  Grid grid;
  Rig rig;
  Projections images;

  Scene(int side, int views, PhantomKind kind, Ranks& ranks)
      : grid(centred_grid(side, side, side, 52.0 / side)),
        rig(*make_ring({.views = views,
                        .spacing_rad = std::numbers::pi / views,
                        .radius_mm = 300,
                        .image_width_px = side,
                        .image_height_px = side},
                       grid)) {
    images.rows = images.cols = side;
    for (const Camera& c : rig.cameras) images.view_names.push_back(c.name);
    images.values.resize(images.views() * images.pixels_per_view());
    if (ranks.rank() == 0) {
      Team team;
      const Projector projector = *Projector::make(rig, grid, {}, team);
      const Layout& layout = projector.layout();
      std::vector<float> packed(layout.pixels());
      projector.forward(team, layout.pack_volume(make_phantom({.kind = kind, .seed = 1}, grid).values),
                        packed);
      images.values = layout.unpack_images(packed);
    }
    ranks.broadcast(0, std::as_writable_bytes(std::span(images.values)));
  }

  Outcome solve(const Recipe& recipe, Ranks* ranks) const {
    ::malloc_trim(0);
    std::ofstream("/proc/self/clear_refs") << 5;
    const Stopwatch watch;
    Outcome out;
    out.result = reconstruct(images, rig, grid, recipe, {.threads = 1, .ranks = ranks}).value();
    out.wall_s = watch.wall_s();
    out.peak_mib = status_mib("VmHWM:");
    out.bits = 0xcbf29ce484222325;
    for (const float v : out.result.volume.values)
      out.bits = (out.bits ^ std::bit_cast<std::uint32_t>(v)) * 0x100000001b3;
    out.result.volume = {};
    return out;
  }
};

double largest(Ranks& ranks, double value) {
  double out = value;
  MPI_Allreduce(&value, &out, 1, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
  return ranks.count() > 0 ? out : 0;
}

// Seconds of an iteration, without what is done once.
double iteration_s(const Reconstruction& r) {
  const auto& h = r.history;
  return h.size() > 1 ? (h.back().elapsed_s - h.front().elapsed_s) / static_cast<double>(h.size() - 1) : NAN;
}

void slabs(Ranks& ranks, const std::string& solver, int side, int views, int iterations) {
  const Scene scene(side, views, PhantomKind::Torus, ranks);
  const Recipe recipe{solver, {{solver + ".max_iterations", std::int64_t{iterations}}}};
  Single single;
  Outcome whole, one;
  if (ranks.rank() == 0) {
    whole = scene.solve(recipe, nullptr);
    one = scene.solve(recipe, &single);
  }
  meet();
  const Outcome all = scene.solve(recipe, &ranks);
  const double wall_s = largest(ranks, all.wall_s), peak_mib = largest(ranks, all.peak_mib);
  meet();
  if (ranks.rank() > 0) return;
  std::printf("%s, %d^3, %d views, %d iterations, one thread a rank\n", solver.c_str(), side, views,
              iterations);
  std::printf("  without slabs   %7.2f s  %6.3f s an iteration  %6.0f MiB\n", whole.wall_s,
              iteration_s(whole.result), whole.peak_mib);
  std::printf("  1 rank          %7.2f s  %6.3f s an iteration  %6.0f MiB\n", one.wall_s,
              iteration_s(one.result), one.peak_mib);
  std::printf("  %d ranks         %7.2f s  %6.3f s an iteration  %6.0f MiB each at most\n", ranks.count(),
              wall_s, iteration_s(all.result), peak_mib);
  std::printf("  speed %.2f whole, %.2f an iteration; memory %.2f; the same bits: %s\n", one.wall_s / wall_s,
              iteration_s(one.result) / iteration_s(all.result), peak_mib / one.peak_mib,
              one.bits == all.bits ? "yes" : "NO");
}

void islands(Ranks& ranks, double fitness, int side) {
  const Scene scene(side, 15, PhantomKind::Stratified, ranks);
  const Recipe recipe{"ert", {{"ert.fit_threshold", fitness}}};
  Outcome one;
  if (ranks.rank() == 0) one = scene.solve(recipe, nullptr);
  meet();
  const Outcome all = scene.solve(recipe, &ranks);
  meet();
  if (ranks.rank() > 0) return;
  const auto tell = [](const char* who, const Outcome& o) {
    std::printf("  %s  %6.2f s  %6d generations  fitness %.5f (%s)\n", who, o.wall_s, o.result.iterations,
                o.result.history.back().fitness, std::string(name_of(o.result.stop_reason)).c_str());
  };
  std::printf("ert, %d^3, 15 views, until fitness %g\n", side, fitness);
  tell("1 island ", one);
  tell("islands  ", all);
  std::printf("  time %.2f of one island\n", all.wall_s / one.wall_s);
}

}  // namespace
}  // namespace flamefield

// Arguments: slabs SIDE VIEWS ITERATIONS SOLVER... | islands SIDE FITNESS
int main(int argc, char** argv) {
  flamefield::MpiRanks ranks(&argc, &argv);
  const std::vector<std::string> words(argv + 1, argv + argc);
  const auto number = [&](std::size_t i, double otherwise) {
    return i < words.size() ? std::stod(words[i]) : otherwise;
  };
  const std::string what = words.empty() ? "both" : words[0];
  std::vector<std::string> solvers(words.begin() + std::min<std::ptrdiff_t>(4, std::ssize(words)),
                                   words.end());
  if (solvers.empty()) solvers = {"hessian"};
  for (const std::string& solver : solvers)
    if (what != "islands")
      flamefield::slabs(ranks, solver, static_cast<int>(number(1, 256)), static_cast<int>(number(2, 24)),
                        static_cast<int>(number(3, 6)));
  if (what != "slabs") flamefield::islands(ranks, number(2, 0.995), static_cast<int>(number(1, 52)));
}
