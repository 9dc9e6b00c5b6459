#include "services/bench/machine_limit.h"

#include <algorithm>
#include <vector>

#include "services/bench/stopwatch.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "services/bench/machine_limit.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace flamefield {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// 16 independent chains hide the latency of both pipes.
float multiply_add(std::size_t rounds, std::size_t* done) {
  const hn::ScalableTag<float> d;
  const auto factor = hn::Set(d, 0.999f), term = hn::Set(d, 0.001f);
  // Chains that began alike would be computed once.
  auto a = hn::Set(d, 1.0f), b = hn::Set(d, 1.0625f), c = hn::Set(d, 1.125f), e = hn::Set(d, 1.1875f),
       f = hn::Set(d, 1.25f), g = hn::Set(d, 1.3125f), h = hn::Set(d, 1.375f), i = hn::Set(d, 1.4375f),
       j = hn::Set(d, 1.5f), k = hn::Set(d, 1.5625f), l = hn::Set(d, 1.625f), m = hn::Set(d, 1.6875f),
       n = hn::Set(d, 1.75f), o = hn::Set(d, 1.8125f), p = hn::Set(d, 1.875f), q = hn::Set(d, 1.9375f);
  for (std::size_t r = 0; r < rounds; ++r) {
    a = hn::MulAdd(a, factor, term), b = hn::MulAdd(b, factor, term), c = hn::MulAdd(c, factor, term);
    e = hn::MulAdd(e, factor, term), f = hn::MulAdd(f, factor, term), g = hn::MulAdd(g, factor, term);
    h = hn::MulAdd(h, factor, term), i = hn::MulAdd(i, factor, term), j = hn::MulAdd(j, factor, term);
    k = hn::MulAdd(k, factor, term), l = hn::MulAdd(l, factor, term), m = hn::MulAdd(m, factor, term);
    n = hn::MulAdd(n, factor, term), o = hn::MulAdd(o, factor, term), p = hn::MulAdd(p, factor, term);
    q = hn::MulAdd(q, factor, term);
  }
  *done = rounds * 16 * hn::Lanes(d);
  const auto sum = hn::Add(hn::Add(hn::Add(a, b), hn::Add(c, e)), hn::Add(hn::Add(f, g), hn::Add(h, i)));
  const auto more = hn::Add(hn::Add(hn::Add(j, k), hn::Add(l, m)), hn::Add(hn::Add(n, o), hn::Add(p, q)));
  return hn::GetLane(hn::Add(sum, more));
}

float load_all(const float* values, std::size_t count) {
  const hn::ScalableTag<float> d;
  const std::size_t lanes = hn::Lanes(d);
  auto a = hn::Zero(d), b = a, c = a, e = a;
  for (std::size_t i = 0; i + 4 * lanes <= count; i += 4 * lanes) {
    a = hn::Add(a, hn::LoadU(d, values + i));
    b = hn::Add(b, hn::LoadU(d, values + i + lanes));
    c = hn::Add(c, hn::LoadU(d, values + i + 2 * lanes));
    e = hn::Add(e, hn::LoadU(d, values + i + 3 * lanes));
  }
  return hn::GetLane(hn::Add(hn::Add(a, b), hn::Add(c, e)));
}

const char* vector_name() {
  return hwy::TargetName(HWY_TARGET);
}

}  // namespace HWY_NAMESPACE
}  // namespace flamefield
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace flamefield {

HWY_EXPORT(multiply_add);
HWY_EXPORT(load_all);
HWY_EXPORT(vector_name);

namespace {

constexpr double kMeasure_s = 0.15;

// The best of many short runs: what the core can do when it is left alone.
template <class Work>
double best_rate(const Work& work) {
  volatile float keep = 0;
  double best = 0;
  const Stopwatch whole;
  while (whole.wall_s() < kMeasure_s) {
    const Stopwatch watch;
    std::size_t done = 0;
    keep = keep + work(&done);
    best = std::max(best, static_cast<double>(done) / std::max(watch.cpu_s(), 1e-9));
  }
  return best;
}

double load_rate(std::size_t bytes, int passes) {
  const std::vector<float> values(bytes / sizeof(float), 1.0f);
  return best_rate([&](std::size_t* done) {
    float sum = 0;
    for (int i = 0; i < passes; ++i) sum += HWY_DYNAMIC_DISPATCH(load_all)(values.data(), values.size());
    *done = values.size() * static_cast<std::size_t>(passes);
    return sum;
  });
}

}  // namespace

MachineLimit measure_machine() {
  MachineLimit out;
  out.fma_per_s =
      best_rate([](std::size_t* done) { return HWY_DYNAMIC_DISPATCH(multiply_add)(20000, done); });
  out.cached_floats_per_s = load_rate(256 << 10, 50);
  out.memory_floats_per_s = load_rate(96 << 20, 1);
  out.vectors = HWY_DYNAMIC_DISPATCH(vector_name)();
  return out;
}

SampleLimit sample_limit(const MachineLimit& machine, double samples, double floats_in_memory) {
  constexpr double kInstructions = 5, kLoads = 2;
  const double arithmetic_s = kInstructions * samples / machine.fma_per_s;
  const double cache_s = kLoads * samples / machine.cached_floats_per_s;
  const double memory_s = floats_in_memory / machine.memory_floats_per_s;
  const double least_s = std::max({arithmetic_s, cache_s, memory_s});
  return {samples / least_s, least_s == memory_s ? "memory" : least_s == cache_s ? "cache" : "arithmetic"};
}

}  // namespace flamefield
#endif
