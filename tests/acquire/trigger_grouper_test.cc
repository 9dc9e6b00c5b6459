#include "acquire/trigger_grouper.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <utility>

namespace flamefield {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr std::int64_t kMs = 1'000'000;

GrouperOptions options_for(std::size_t cameras, std::int64_t deadline_ms = 1000) {
  GrouperOptions options;
  for (std::size_t i = 0; i < cameras; ++i) options.cameras.push_back(concat("cam", i));
  options.deadline_ns = deadline_ms * kMs;
  return options;
}

Arrival counted(std::int64_t count, std::int64_t exposure_ns = 0) {
  Arrival arrival;
  arrival.trigger_count = count;
  arrival.exposure_utc_ns = exposure_ns;
  return arrival;
}

Arrival uncounted(std::int64_t exposure_ns) {
  Arrival arrival;
  arrival.exposure_utc_ns = exposure_ns;
  return arrival;
}

LossCause loss_in(const FrameSet& set, const std::string& camera) {
  for (const FrameLoss& loss : set.losses) {
    if (loss.camera == camera) return loss.cause;
  }
  ADD_FAILURE() << camera << " lost nothing in pulse " << set.pulse;
  return LossCause::Duplicate;
}

void append(std::vector<FrameSet>& all, std::vector<FrameSet> more) {
  std::move(more.begin(), more.end(), std::back_inserter(all));
}

TEST(TriggerGrouper, SetIsOutAsSoonAsAllCamerasDelivered) {
  TriggerGrouper grouper(options_for(3));
  EXPECT_THAT(grouper.add(1, counted(1), 10), IsEmpty());
  EXPECT_THAT(grouper.add(0, counted(1), 11), IsEmpty());
  const auto sets = grouper.add(2, counted(1), 12);
  ASSERT_THAT(sets, SizeIs(1));
  EXPECT_THAT(sets[0].frames, SizeIs(3));
  EXPECT_THAT(sets[0].losses, IsEmpty());
  EXPECT_EQ(sets[0].pulse, 1);
  EXPECT_EQ(sets[0].complete_time_ns, 12);
}

TEST(TriggerGrouper, CameraThatMovedOnHasMissedThePulseAndNobodyWaits) {
  TriggerGrouper grouper(options_for(2));
  EXPECT_THAT(grouper.add(0, counted(1), 0), IsEmpty());
  const auto sets = grouper.add(1, counted(2), 1);
  ASSERT_THAT(sets, SizeIs(1));
  EXPECT_EQ(sets[0].pulse, 1);
  EXPECT_EQ(loss_in(sets[0], "cam1"), LossCause::Missed);
}

TEST(TriggerGrouper, SetsWaitForEarlierOnes) {
  TriggerGrouper grouper(options_for(2));
  grouper.add(0, counted(1), 0);
  grouper.add(0, counted(2), 1);
  const auto sets = grouper.add(1, counted(2), 2);  // cam1 skipped pulse 1: both are out, in order
  ASSERT_THAT(sets, SizeIs(2));
  EXPECT_EQ(sets[0].pulse, 1);
  EXPECT_EQ(sets[1].pulse, 2);
}

TEST(TriggerGrouper, DeadlineNamesTheMissingCameraLateAndCountsItsFrameThen) {
  TriggerGrouper grouper(options_for(2));
  grouper.add(0, counted(1), 0);
  EXPECT_THAT(grouper.advance(1000 * kMs - 1), IsEmpty());
  const auto sets = grouper.advance(1000 * kMs);
  ASSERT_THAT(sets, SizeIs(1));
  EXPECT_EQ(loss_in(sets[0], "cam1"), LossCause::Late);
  EXPECT_THAT(grouper.add(1, counted(1), 1001 * kMs), IsEmpty());
  EXPECT_EQ(grouper.tallies()[1].late, 1);
}

TEST(TriggerGrouper, FailedBufferNamesTheGapThatItLeft) {
  TriggerGrouper grouper(options_for(2));
  std::vector<FrameSet> sets;
  for (std::int64_t pulse = 1; pulse <= 4; ++pulse) {
    append(sets, grouper.add(0, counted(pulse), pulse));
    append(sets, pulse == 3 ? grouper.lose(1, LossCause::Incomplete, pulse)
                            : grouper.add(1, counted(pulse), pulse));
  }
  ASSERT_THAT(sets, SizeIs(4));
  EXPECT_EQ(loss_in(sets[2], "cam1"), LossCause::Incomplete);
  EXPECT_EQ(grouper.tallies()[1].unplaced, 0);
}

TEST(TriggerGrouper, FailedBufferWithoutAGapIsCountedAsUnplaced) {
  TriggerGrouper grouper(options_for(1));
  grouper.lose(0, LossCause::Incomplete, 0);
  EXPECT_THAT(grouper.add(0, counted(1), 1).at(0).losses, IsEmpty());
  EXPECT_EQ(grouper.tallies()[0].unplaced, 1);
}

TEST(TriggerGrouper, SecondFrameOfAPulseIsADuplicate) {
  TriggerGrouper grouper(options_for(2));
  grouper.add(0, counted(1), 0);
  grouper.add(0, counted(1), 1);
  EXPECT_THAT(grouper.add(1, counted(1), 2), SizeIs(1));
  grouper.add(1, counted(1), 3);
  EXPECT_EQ(grouper.tallies()[0].duplicates, 1);
  EXPECT_EQ(grouper.tallies()[1].duplicates, 1);
}

TEST(TriggerGrouper, LostCameraHoldsNobodyUpAndIsWelcomeBack) {
  TriggerGrouper grouper(options_for(2));
  EXPECT_THAT(grouper.lose_camera(1, 0), IsEmpty());
  const auto without = grouper.add(0, counted(1), 1);
  ASSERT_THAT(without, SizeIs(1));
  EXPECT_EQ(loss_in(without[0], "cam1"), LossCause::CameraLost);
  EXPECT_THAT(grouper.add(1, counted(2), 2), IsEmpty());
  EXPECT_FALSE(grouper.is_lost(1));
  EXPECT_THAT(grouper.add(0, counted(2), 3).at(0).losses, IsEmpty());
}

TEST(TriggerGrouper, CameraSilentForTwoPulsesIsLostShortlyAfterTheSecond) {
  TriggerGrouper grouper(options_for(3));
  for (std::int64_t pulse = 1; pulse <= 10; ++pulse) {
    for (std::size_t camera = 0; camera < (pulse <= 8 ? 3u : 2u); ++camera) {
      grouper.add(camera, counted(pulse, pulse * 200 * kMs), pulse * 200 * kMs + 30 * kMs);
    }
  }
  EXPECT_FALSE(grouper.is_lost(2));
  EXPECT_THAT(grouper.advance(2129 * kMs), SizeIs(0));  // pulse 9 was out at 2030 ms, one period old
  EXPECT_FALSE(grouper.is_lost(2));
  const auto sets = grouper.advance(2130 * kMs);
  EXPECT_TRUE(grouper.is_lost(2));
  ASSERT_THAT(sets, SizeIs(1));
  EXPECT_EQ(loss_in(sets[0], "cam2"), LossCause::CameraLost);
}

TEST(TriggerGrouper, NoSetWaitsForOneCameraLongerThanAPeriod) {
  TriggerGrouper grouper(options_for(3));
  std::vector<FrameSet> sets;
  for (std::int64_t pulse = 1; pulse <= 9; ++pulse) {
    for (std::size_t camera = 0; camera < (pulse <= 8 ? 3u : 2u); ++camera) {
      append(sets, grouper.add(camera, counted(pulse, pulse * 200 * kMs), pulse * 200 * kMs));
    }
  }
  ASSERT_THAT(sets, SizeIs(8));
  EXPECT_EQ(grouper.next_deadline_ns(), 1900 * kMs) << "when the third camera is to be asked";
  EXPECT_THAT(grouper.take_overdue(1899 * kMs), IsEmpty());
  EXPECT_THAT(grouper.take_overdue(1900 * kMs), ::testing::ElementsAre(2u));
  EXPECT_THAT(grouper.take_overdue(1900 * kMs), IsEmpty()) << "once a pulse";
  EXPECT_EQ(grouper.next_deadline_ns(), 2000 * kMs);
  EXPECT_THAT(grouper.advance(2000 * kMs - 1), IsEmpty());
  const auto late = grouper.advance(2000 * kMs);
  ASSERT_THAT(late, SizeIs(1));
  EXPECT_EQ(loss_in(late[0], "cam2"), LossCause::Late);
}

TEST(TriggerGrouper, CameraThatAnswersButOwesAFrameHasMissedThePulse) {
  TriggerGrouper grouper(options_for(3));
  for (std::int64_t pulse = 1; pulse <= 9; ++pulse) {
    for (std::size_t camera = 0; camera < (pulse <= 8 ? 3u : 2u); ++camera) {
      grouper.add(camera, counted(pulse, pulse * 200 * kMs), pulse * 200 * kMs);
    }
  }
  ASSERT_THAT(grouper.take_overdue(1900 * kMs), ::testing::ElementsAre(2u));
  grouper.answered(2);
  const auto sets = grouper.advance(2000 * kMs);
  ASSERT_THAT(sets, SizeIs(1));
  EXPECT_EQ(loss_in(sets[0], "cam2"), LossCause::Missed);
}

TEST(TriggerGrouper, OnlyTheWantedPulsesAreGrouped) {
  GrouperOptions options = options_for(1);
  options.pulses = 2;
  options.first_count = 10;
  TriggerGrouper grouper(options);
  EXPECT_THAT(grouper.add(0, counted(10), 0), IsEmpty());
  EXPECT_EQ(grouper.add(0, counted(11), 1).at(0).pulse, 1);
  EXPECT_EQ(grouper.add(0, counted(12), 2).at(0).pulse, 2);
  EXPECT_THAT(grouper.add(0, counted(13), 3), IsEmpty());
  EXPECT_EQ(grouper.tallies()[0].before_start, 1);
  EXPECT_EQ(grouper.tallies()[0].unwanted, 1);
}

TEST(TriggerGrouper, CounterOutOfAllReasonOpensNoSets) {
  TriggerGrouper grouper(options_for(1));
  EXPECT_THAT(grouper.add(0, counted(2'000'000'000), 0), IsEmpty());
  EXPECT_EQ(grouper.tallies()[0].implausible, 1);
  EXPECT_EQ(grouper.pulses_seen(), 0);
}

TEST(TriggerGrouper, EndOwesASetForEveryPulseAndNoneAfterIt) {
  TriggerGrouper grouper(options_for(2));
  std::vector<FrameSet> sets = grouper.add(0, counted(1), 0);
  append(sets, grouper.add(1, counted(1), 0));
  append(sets, grouper.add(0, counted(4), 1));  // beyond the end
  append(sets, grouper.end_at(3, 2));
  append(sets, grouper.flush(3));
  ASSERT_THAT(sets, SizeIs(3));
  EXPECT_EQ(loss_in(sets[2], "cam1"), LossCause::Missed);
  EXPECT_EQ(grouper.tallies()[0].unwanted, 1);
  EXPECT_EQ(grouper.pulses_seen(), 3);
}

TEST(TriggerGrouper, FramesWithoutACountJoinTheNearestPulse) {
  TriggerGrouper grouper(options_for(3));
  std::vector<FrameSet> sets;
  for (std::int64_t pulse = 1; pulse <= 6; ++pulse) {
    const std::int64_t edge_ns = pulse * 200 * kMs;
    append(sets, grouper.add(0, uncounted(edge_ns + 1 * kMs), edge_ns));
    append(sets, grouper.add(1, uncounted(edge_ns - 1 * kMs), edge_ns));
    if (pulse != 4) append(sets, grouper.add(2, uncounted(edge_ns), edge_ns));
  }
  ASSERT_THAT(sets, SizeIs(6));
  for (const FrameSet& set : sets) EXPECT_EQ(set.frames.size(), set.pulse == 4 ? 2u : 3u);
  EXPECT_EQ(sets[3].losses.at(0).camera, "cam2");
}

// What one random run of an array delivers: for each camera its frames in order, some pulses missing.
struct Schedule {
  std::size_t cameras = 0;
  std::int64_t pulses = 0;
  std::vector<std::vector<std::int64_t>> delivered;  // by camera, rising pulse numbers
};

Schedule random_schedule(std::mt19937& random) {
  Schedule schedule;
  schedule.cameras = 1 + random() % 6;
  schedule.pulses = 1 + static_cast<std::int64_t>(random() % 12);
  const double chance = std::uniform_real_distribution<>(0.3, 1.0)(random);
  for (std::size_t i = 0; i < schedule.cameras; ++i) {
    schedule.delivered.emplace_back();
    for (std::int64_t pulse = 1; pulse <= schedule.pulses; ++pulse) {
      if (std::uniform_real_distribution<>()(random) < chance) schedule.delivered.back().push_back(pulse);
    }
  }
  return schedule;
}

// All frames in a random order that keeps each camera's own.
std::vector<std::pair<std::size_t, std::int64_t>> interleave(const Schedule& schedule, std::mt19937& random) {
  std::vector<std::size_t> turns;
  for (std::size_t i = 0; i < schedule.cameras; ++i)
    turns.insert(turns.end(), schedule.delivered[i].size(), i);
  std::shuffle(turns.begin(), turns.end(), random);
  std::vector<std::size_t> next(schedule.cameras, 0);
  std::vector<std::pair<std::size_t, std::int64_t>> out;
  for (std::size_t camera : turns) out.emplace_back(camera, schedule.delivered[camera][next[camera]++]);
  return out;
}

TEST(TriggerGrouper, AnyInterleavingGivesTheSetsThatBruteForceFinds) {
  for (unsigned seed = 0; seed < 500; ++seed) {
    SCOPED_TRACE(concat("seed ", seed));
    std::mt19937 random(seed);
    const Schedule schedule = random_schedule(random);
    TriggerGrouper grouper(options_for(schedule.cameras, 1'000'000));
    std::vector<FrameSet> sets;
    for (const auto& [camera, pulse] : interleave(schedule, random)) {
      Arrival arrival = counted(pulse);
      arrival.frame.camera = concat("cam", camera);
      append(sets, grouper.add(camera, std::move(arrival), 1));
    }
    append(sets, grouper.end_at(schedule.pulses, 2));
    append(sets, grouper.flush(3));
    ASSERT_EQ(sets.size(), static_cast<std::size_t>(schedule.pulses));
    for (std::int64_t pulse = 1; pulse <= schedule.pulses; ++pulse) {
      const FrameSet& set = sets[static_cast<std::size_t>(pulse - 1)];
      ASSERT_EQ(set.pulse, pulse);
      std::set<std::string> wanted, got;
      for (std::size_t i = 0; i < schedule.cameras; ++i) {
        if (std::ranges::count(schedule.delivered[i], pulse) > 0) wanted.insert(concat("cam", i));
      }
      for (const Frame& frame : set.frames) {
        EXPECT_EQ(frame.pulse, pulse);
        got.insert(frame.camera);
      }
      EXPECT_EQ(got, wanted);
      EXPECT_EQ(set.frames.size() + set.losses.size(), schedule.cameras);
      for (const FrameLoss& loss : set.losses) EXPECT_EQ(loss.cause, LossCause::Missed);
    }
  }
}

TEST(TriggerGrouper, EveryFrameIsAccountedForUnderTightDeadlines) {
  for (unsigned seed = 0; seed < 500; ++seed) {
    SCOPED_TRACE(concat("seed ", seed));
    std::mt19937 random(seed);
    const Schedule schedule = random_schedule(random);
    GrouperOptions options = options_for(schedule.cameras, 20);
    options.pulses = random() % 2 == 0 ? schedule.pulses / 2 : 0;
    TriggerGrouper grouper(options);
    std::vector<FrameSet> sets;
    std::int64_t now_ns = 0;
    std::vector<std::int64_t> sent(schedule.cameras, 0);
    for (const auto& [camera, pulse] : interleave(schedule, random)) {
      now_ns += static_cast<std::int64_t>(random() % 15) * kMs;
      if (random() % 10 == 0) append(sets, grouper.lose(camera, LossCause::Incomplete, now_ns));
      if (random() % 20 == 0) append(sets, grouper.lose_camera(camera, now_ns));
      for (int repeat = random() % 10 == 0 ? 2 : 1; repeat > 0; --repeat, ++sent[camera]) {
        append(sets, grouper.add(camera, counted(pulse), now_ns));
      }
      EXPECT_GE(grouper.next_deadline_ns().value_or(now_ns), now_ns - 20 * kMs);
    }
    append(sets, grouper.flush(now_ns));
    ASSERT_EQ(static_cast<std::int64_t>(sets.size()), grouper.pulses_seen());
    for (std::size_t i = 0; i < sets.size(); ++i) EXPECT_EQ(sets[i].pulse, static_cast<std::int64_t>(i) + 1);
    for (std::size_t i = 0; i < schedule.cameras; ++i) {
      const CameraTally& tally = grouper.tallies()[i];
      EXPECT_EQ(tally.frames_in, sent[i]);
      EXPECT_EQ(tally.frames_in, tally.delivered + tally.late + tally.duplicates + tally.unwanted +
                                     tally.before_start + tally.implausible + tally.extra);
      EXPECT_EQ(grouper.pulses_seen(),
                tally.delivered + std::accumulate(tally.losses.begin(), tally.losses.end(), std::int64_t{0}));
    }
  }
}

// Of two cameras or one; more let a single witness wait for a second, see below.
TEST(TriggerGrouper, NoSetWaitsLongerThanItsDeadline) {
  for (unsigned seed = 0; seed < 500; ++seed) {
    SCOPED_TRACE(concat("seed ", seed));
    std::mt19937 random(seed);
    const Schedule schedule = random_schedule(random);
    if (schedule.cameras > 2) continue;
    TriggerGrouper grouper(options_for(schedule.cameras, 50));
    std::map<std::int64_t, std::int64_t> first_sign_ns;
    std::int64_t now_ns = 0, newest = 0;
    const auto check = [&](const std::vector<FrameSet>& sets) {
      for (const FrameSet& set : sets) EXPECT_LE(set.complete_time_ns, first_sign_ns[set.pulse] + 50 * kMs);
    };
    for (const auto& [camera, pulse] : interleave(schedule, random)) {
      const std::int64_t next_ns = now_ns + static_cast<std::int64_t>(random() % 40) * kMs;
      for (auto due = grouper.next_deadline_ns(); due && *due <= next_ns; due = grouper.next_deadline_ns()) {
        check(grouper.advance(*due));
      }
      now_ns = next_ns;
      for (; newest < pulse; ++newest) first_sign_ns[newest + 1] = now_ns;
      check(grouper.add(camera, counted(pulse), now_ns));
    }
  }
}

// Noise on one camera's trigger line while the train pauses: its frame must not take the number of the next
// pulse.
TEST(TriggerGrouper, FrameThatOneCameraAloneHasWaitsForAWitness) {
  TriggerGrouper grouper(options_for(3));
  for (std::int64_t pulse = 1; pulse <= 10; ++pulse) {
    for (std::size_t camera = 0; camera < 3; ++camera)
      grouper.add(camera, counted(pulse, pulse * 200 * kMs), pulse * 200 * kMs);
  }
  EXPECT_THAT(grouper.add(0, counted(11, 2500 * kMs), 2500 * kMs), IsEmpty());
  EXPECT_THAT(grouper.advance(9000 * kMs), IsEmpty());
  std::vector<FrameSet> sets;
  append(sets, grouper.add(0, counted(12, 10'000 * kMs), 10'001 * kMs));
  append(sets, grouper.add(1, counted(11, 10'000 * kMs), 10'002 * kMs));
  append(sets, grouper.add(2, counted(11, 10'000 * kMs), 10'003 * kMs));
  ASSERT_THAT(sets, SizeIs(1));
  EXPECT_EQ(sets[0].pulse, 11);
  EXPECT_THAT(sets[0].losses, IsEmpty());
  EXPECT_EQ(grouper.tallies()[0].extra, 1);
  EXPECT_EQ(grouper.pulse_of_count(0, 13), 12);
}

}  // namespace
}  // namespace flamefield
