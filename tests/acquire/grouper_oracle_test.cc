// The grouper against worlds in which the true pulse of every frame is known: random trains, clocks, drifts,
// latencies, losses, noise on trigger lines, restarts, wrapped counters.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <set>

#include "acquire/trigger_grouper.h"

namespace flamefield {
namespace {

constexpr std::int64_t kMs = 1'000'000;

enum class Counting { All, None, Half };

struct Event {  // one frame reaches the grouper, or a camera is started again
  std::int64_t arrival_ns = 0;
  std::size_t camera = 0;
  std::optional<Arrival> frame;
};

struct World {
  std::size_t cameras = 0;
  std::vector<std::int64_t> pulses_ns;                       // true time of pulse 1, 2, ...
  std::vector<Event> events;                                 // in order of arrival
  std::vector<std::pair<std::size_t, std::int64_t>> frames;  // by id: camera and true pulse; 0: a stray edge
  std::size_t strays = 0;
  std::uint32_t first_count = 0;
};

class WorldMaker {
 public:
  WorldMaker(std::mt19937_64& random, Counting counting) : random_(random), counting_(counting) {}

  World make() {
    world_.cameras = (counting_ == Counting::Half ? 8 : 4) + random_() % 5;
    world_.first_count = random_() % 3 == 0 ? 0xffffffffu - static_cast<std::uint32_t>(random_() % 40) : 0;
    make_train(40 + random_() % 40);
    plan_faults();
    for (std::size_t camera = 0; camera < world_.cameras; ++camera) run_camera(camera);
    std::stable_sort(world_.events.begin(), world_.events.end(),
                     [](const Event& a, const Event& b) { return a.arrival_ns < b.arrival_ns; });
    return world_;
  }

 private:
  enum class Fault { Missed, Unseen, Stray, Lost, Repeated, Restart };

  double real(double low, double high) { return std::uniform_real_distribution<>(low, high)(random_); }

  void make_train(std::size_t pulses) {
    constexpr std::int64_t kPeriods_ms[] = {10, 50, 200, 1000};
    const std::int64_t period_ns = kPeriods_ms[random_() % 4] * kMs;
    // Without counters only a cadence tells a pulse that nobody saw from none; irregular trains need numbers.
    const bool is_irregular = counting_ == Counting::All && random_() % 3 == 0;
    gap_ns_ = period_ns;
    std::int64_t now_ns = 1'700'000'000'000'000'000;
    for (std::size_t i = 0; i < pulses; ++i) {
      world_.pulses_ns.push_back(now_ns);
      now_ns += static_cast<std::int64_t>(static_cast<double>(period_ns) *
                                          (is_irregular ? real(1, 3) : real(0.999, 1.001)));
      if (is_irregular && random_() % 15 == 0) now_ns += static_cast<std::int64_t>(real(1, 4) * 1e9);
    }
  }

  // One camera at a time is odd; each has recovered before the next one is.
  void plan_faults() {
    for (std::size_t pulse = 12; pulse + 8 < world_.pulses_ns.size(); pulse += 5 + random_() % 4) {
      // A clock set anew is on UTC, from which the array has drifted: closer pulses could not be told apart.
      const auto fault = static_cast<Fault>(random_() % (gap_ns_ < 50 * kMs ? 5 : 6));
      faults_[{random_() % world_.cameras, static_cast<std::int64_t>(pulse)}] = fault;
      if (fault == Fault::Restart) pulse += 14 + static_cast<std::size_t>(1000 * kMs / gap_ns_);
    }
  }

  void run_camera(std::size_t camera) {
    const bool counts = counting_ == Counting::All || (counting_ == Counting::Half && camera % 2 == 0);
    std::uint32_t count = world_.first_count;
    start_clock();
    free_ns_ = 0;
    std::int64_t down_until = 0;
    for (std::int64_t pulse = 1; pulse <= static_cast<std::int64_t>(world_.pulses_ns.size()); ++pulse) {
      const std::int64_t time_ns = world_.pulses_ns[static_cast<std::size_t>(pulse - 1)];
      if (pulse < down_until) continue;
      if (pulse == down_until) {
        start_clock();
        count = 0;
        world_.events.push_back({time_ns - kMs, camera, std::nullopt});
      }
      const auto found = faults_.find({camera, pulse});
      const std::optional<Fault> fault = found == faults_.end() ? std::nullopt : std::optional(found->second);
      if (fault == Fault::Restart) {
        // What it sent before has arrived by the time it is back.
        const std::int64_t back_ns = time_ns + static_cast<std::int64_t>(real(60, 1000) * 1e6);
        for (down_until = pulse + 1; down_until <= static_cast<std::int64_t>(world_.pulses_ns.size()) &&
                                     world_.pulses_ns[static_cast<std::size_t>(down_until - 1)] < back_ns;)
          ++down_until;
        continue;
      }
      if (fault == Fault::Unseen) continue;
      ++count;
      if (fault != Fault::Missed && fault != Fault::Lost) {
        send(camera, pulse, time_ns, counts, count);
        if (fault == Fault::Repeated) send(camera, pulse, time_ns, counts, count);
      }
      if (fault == Fault::Stray) {
        ++world_.strays;
        ++count;
        send(camera, 0, time_ns + static_cast<std::int64_t>(real(0.4, 0.65) * static_cast<double>(gap_ns_)),
             counts, count);
      }
    }
  }

  void start_clock() {
    const double most_ns = 0.05 * static_cast<double>(std::min<std::int64_t>(gap_ns_, 40 * kMs));
    anchor_error_ns_ = real(-most_ns, most_ns);
    drift_ = real(-100e-6, 100e-6);
    begin_ns_ = world_.pulses_ns.front();
  }

  void send(std::size_t camera, std::int64_t pulse, std::int64_t time_ns, bool counts, std::uint32_t count) {
    const auto since_ns = static_cast<double>(time_ns - begin_ns_);
    Arrival arrival;
    arrival.exposure_utc_ns = time_ns + std::llround(anchor_error_ns_ + drift_ * since_ns + real(-1e3, 1e3));
    if (counts) arrival.trigger_count = count;
    arrival.frame.camera = concat("cam", camera);
    arrival.frame.device_time_ns = static_cast<std::int64_t>(world_.frames.size());  // its id
    world_.frames.emplace_back(camera, pulse);
    free_ns_ = std::max(free_ns_ + 1, time_ns + static_cast<std::int64_t>(real(5, 40) * 1e6));
    world_.events.push_back({free_ns_, camera, std::move(arrival)});
  }

  std::mt19937_64& random_;
  const Counting counting_;
  World world_;
  std::map<std::pair<std::size_t, std::int64_t>, Fault> faults_;
  std::int64_t gap_ns_ = 0;
  double anchor_error_ns_ = 0, drift_ = 0;
  std::int64_t begin_ns_ = 0, free_ns_ = 0;
};

std::vector<FrameSet> group(TriggerGrouper& grouper, const World& world, Counting counting) {
  std::vector<FrameSet> sets;
  const auto collect = [&](std::vector<FrameSet> more) {
    std::move(more.begin(), more.end(), std::back_inserter(sets));
  };
  std::int64_t now_ns = 0;
  const auto wait_until = [&](std::int64_t until_ns) {
    for (int i = 0; i < 10'000; ++i) {
      const auto due_ns = grouper.next_deadline_ns();
      if (!due_ns || *due_ns > until_ns) break;
      now_ns = std::max(now_ns, *due_ns);
      collect(grouper.advance(now_ns));
      for (std::size_t camera : grouper.take_overdue(now_ns)) grouper.answered(camera);
      EXPECT_LT(i, 9'999) << "the grouper asks to be called again and again";
    }
    now_ns = until_ns;
  };
  for (const Event& event : world.events) {
    wait_until(event.arrival_ns);
    if (event.frame) {
      collect(grouper.add(event.camera, *event.frame, now_ns));
    } else {
      grouper.rejoin(event.camera);
    }
  }
  const auto pulses = static_cast<std::int64_t>(world.pulses_ns.size());
  if (counting != Counting::None) collect(grouper.end_at(pulses, now_ns));
  wait_until(now_ns + 3'000 * kMs);
  collect(grouper.flush(now_ns));
  return sets;
}

class GrouperOracle : public ::testing::TestWithParam<Counting> {};

TEST_P(GrouperOracle, EveryFrameIsInTheSetOfItsTruePulseAndNoStrayIsInAny) {
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    SCOPED_TRACE(concat("seed ", seed));
    std::mt19937_64 random(seed);
    const World world = WorldMaker(random, GetParam()).make();
    GrouperOptions options;
    for (std::size_t i = 0; i < world.cameras; ++i) options.cameras.push_back(concat("cam", i));
    options.first_count = world.first_count;
    TriggerGrouper grouper(options);
    const std::vector<FrameSet> sets = group(grouper, world, GetParam());
    ASSERT_EQ(sets.size(), world.pulses_ns.size());
    std::set<std::int64_t> delivered;
    for (const FrameSet& set : sets) {
      EXPECT_EQ(set.frames.size() + set.losses.size(), world.cameras);
      for (const Frame& frame : set.frames) {
        const auto& [camera, pulse] = world.frames[static_cast<std::size_t>(frame.device_time_ns)];
        EXPECT_EQ(pulse, set.pulse) << "camera " << camera;
        EXPECT_EQ(frame.pulse, set.pulse);
        EXPECT_EQ(frame.camera, concat("cam", camera));
        delivered.insert(static_cast<std::int64_t>(camera) * 100'000 + pulse);
      }
    }
    std::int64_t extra = 0;
    for (std::size_t camera = 0; camera < world.cameras; ++camera) {
      const CameraTally& tally = grouper.tallies()[camera];
      extra += tally.extra;
      EXPECT_EQ(tally.frames_in, tally.delivered + tally.late + tally.duplicates + tally.unwanted +
                                     tally.before_start + tally.implausible + tally.extra);
      EXPECT_EQ(static_cast<std::int64_t>(sets.size()),
                tally.delivered + std::accumulate(tally.losses.begin(), tally.losses.end(), std::int64_t{0}));
    }
    EXPECT_EQ(extra, static_cast<std::int64_t>(world.strays));
    for (const auto& [camera, pulse] : world.frames) {
      if (pulse == 0) continue;
      EXPECT_TRUE(delivered.contains(static_cast<std::int64_t>(camera) * 100'000 + pulse))
          << "camera " << camera << " pulse " << pulse << " of " << world.pulses_ns.size()
          << " was thrown away: late " << grouper.tallies()[camera].late << " duplicate "
          << grouper.tallies()[camera].duplicates << " unwanted " << grouper.tallies()[camera].unwanted
          << " extra " << grouper.tallies()[camera].extra;
    }
    if (HasFailure()) break;
  }
}

INSTANTIATE_TEST_SUITE_P(Counters, GrouperOracle,
                         ::testing::Values(Counting::All, Counting::None, Counting::Half),
                         [](const auto& test) {
                           return std::string(test.param == Counting::All    ? "InAllCameras"
                                              : test.param == Counting::None ? "InNone"
                                                                             : "InSomeCameras");
                         });

}  // namespace
}  // namespace flamefield
