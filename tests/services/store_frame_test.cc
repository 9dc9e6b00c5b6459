#include <gtest/gtest.h>

#include <random>

#include "services/store/file.h"
#include "services/store/frame_file.h"
#include "services/store/projection_file.h"
#include "tests/support/scratch.h"

namespace flamefield {
namespace {

Frame frame_of(const std::string& camera, std::int64_t pulse, PixelFormat format) {
  Frame frame{camera, pulse, 1'000 * pulse + 7, 2'000 * pulse + 9, 850, 12, 5, format, nullptr};
  auto bytes = std::make_shared<std::vector<std::byte>>(bytes_of_image(format, 12, 5));
  for (std::size_t i = 0; i < bytes->size(); ++i) {
    // The upper byte of a 12-bit pixel holds four bits.
    const bool is_upper = format == PixelFormat::Mono12 && i % 2 == 1;
    (*bytes)[i] = static_cast<std::byte>((i * 31 + static_cast<std::size_t>(pulse)) % (is_upper ? 16 : 256));
  }
  frame.bytes = std::move(bytes);
  return frame;
}

// A dark set, and two sets of a burst in the second of which camera b missed the pulse.
std::vector<FrameSet> short_session() {
  std::vector<FrameSet> sets(3);
  for (std::size_t i = 0; i < 3; ++i) {
    FrameSet& set = sets[i];
    set.capture = i == 0 ? "20260301T101500-dark" : "20260301T101600-burst";
    set.kind = i == 0 ? CaptureKind::Dark : CaptureKind::Burst;
    set.pulse = 40 + static_cast<std::int64_t>(i);
    set.index = i == 0 ? 0 : static_cast<std::int64_t>(i) - 1;
    set.pulse_time_ns = 1'772'360'100'000'000'000 + set.pulse;
    set.complete_time_ns = set.pulse_time_ns + 30'000'000;
    set.frames.push_back(frame_of("a", set.pulse, PixelFormat::Mono8));
    if (i == 2) {
      set.losses.push_back({"b", LossCause::Missed});
    } else {
      set.frames.push_back(frame_of("b", set.pulse, PixelFormat::Mono12));
    }
  }
  return sets;
}

TEST(FrameFile, KeepsEveryFrameEveryLossAndEveryTime) {
  const Scratch scratch;
  const auto sets = short_session();
  ASSERT_TRUE(write_frames(scratch / "run.nxs", sets, {{"recorder", "test"}}));
  const auto back = read_frames(scratch / "run.nxs");
  ASSERT_TRUE(back) << back.error().message;
  ASSERT_EQ(back->size(), sets.size());
  for (std::size_t s = 0; s < sets.size(); ++s) {
    const FrameSet &wrote = sets[s], &read = (*back)[s];
    EXPECT_EQ(read.capture, wrote.capture);
    EXPECT_EQ(read.kind, wrote.kind);
    EXPECT_EQ(read.pulse, wrote.pulse);
    EXPECT_EQ(read.index, wrote.index);
    EXPECT_EQ(read.pulse_time_ns, wrote.pulse_time_ns);
    EXPECT_EQ(read.complete_time_ns, wrote.complete_time_ns);
    ASSERT_EQ(read.losses.size(), wrote.losses.size());
    for (std::size_t l = 0; l < read.losses.size(); ++l)
      EXPECT_EQ(read.losses[l].cause, wrote.losses[l].cause);
    ASSERT_EQ(read.frames.size(), wrote.frames.size());
    for (std::size_t f = 0; f < read.frames.size(); ++f) {
      EXPECT_EQ(read.frames[f].camera, wrote.frames[f].camera);
      EXPECT_EQ(read.frames[f].device_time_ns, wrote.frames[f].device_time_ns);
      EXPECT_EQ(read.frames[f].arrival_time_ns, wrote.frames[f].arrival_time_ns);
      EXPECT_EQ(read.frames[f].exposure_us, wrote.frames[f].exposure_us);
      EXPECT_EQ(read.frames[f].format, wrote.frames[f].format);
      EXPECT_EQ(*read.frames[f].bytes, *wrote.frames[f].bytes);
    }
  }
}

TEST(FrameFile, UnpacksTwelveBitPixelsWithoutChangingThem) {
  const Scratch scratch;
  FrameSet set;
  set.frames.push_back(frame_of("a", 3, PixelFormat::Mono12Packed));
  ASSERT_TRUE(write_frames(scratch / "run.nxs", {set}, {}));
  const auto back = read_frames(scratch / "run.nxs");
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ((*back)[0].frames[0].format, PixelFormat::Mono12);
  EXPECT_EQ(grey_levels((*back)[0].frames[0])->pixels, grey_levels(set.frames[0])->pixels);
}

TEST(FrameFile, KeepsACaptureWithoutASingleSet) {
  const Scratch scratch;
  ASSERT_TRUE(write_frames(scratch / "run.nxs", {}, {}));
  const auto back = read_frames(scratch / "run.nxs");
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_TRUE(back->empty());
}

TEST(FrameFile, RefusesAFrameWithTooFewBytesAndLeavesNothing) {
  const Scratch scratch;
  auto sets = short_session();
  sets[0].frames[0].bytes = std::make_shared<std::vector<std::byte>>(3);
  EXPECT_FALSE(write_frames(scratch / "run.nxs", sets, {}));
  sets = short_session();
  sets[1].frames[0].width_px = 11;
  EXPECT_FALSE(write_frames(scratch / "run.nxs", sets, {}));
  EXPECT_TRUE(scratch.is_empty());
}

TEST(FrameFile, CutShortAnywhereIsAnErrorThatNamesTheFile) {
  const Scratch scratch;
  ASSERT_TRUE(write_frames(scratch / "whole.nxs", short_session(), {}));
  const std::string bytes = *read_text_file(scratch / "whole.nxs");
  for (std::size_t length = 0; length < bytes.size(); length += 1 + bytes.size() / 150) {
    overwrite(scratch / "cut.nxs", bytes.substr(0, length));
    const auto sets = read_frames(scratch / "cut.nxs");
    ASSERT_FALSE(sets) << length;
    EXPECT_NE(sets.error().message.find("cut.nxs"), std::string::npos);
  }
}

TEST(FrameFile, DamageIsRefusedOrHarmless) {
  const Scratch scratch;
  ASSERT_TRUE(write_frames(scratch / "run.nxs", short_session(), {}));
  const std::string bytes = *read_text_file(scratch / "run.nxs");
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  for (int trial = 0; trial < 300; ++trial) {
    std::string damaged = bytes;
    damaged[random() % damaged.size()] ^= static_cast<char>(1u << random() % 8);
    overwrite(scratch / "run.nxs", damaged);
    const auto sets = read_frames(scratch / "run.nxs");
    EXPECT_TRUE(!sets || sets->size() == 3u);
  }
}

Projections three_views() {
  Projections p{{"cam00", "cam01", "cam02"}, 4, 5, std::vector<float>(60)};
  for (std::size_t i = 0; i < p.values.size(); ++i) p.values[i] = static_cast<float>(i) * 0.1f;
  return p;
}

TEST(ProjectionFile, KeepsValuesAndNames) {
  const Scratch scratch;
  for (const char* name : {"p.nxs", "p.npy", "p.tif"}) {
    ASSERT_TRUE(write_projections(scratch / name, three_views(), {{"step_voxels", "0.5"}}));
    const auto back = read_projections(scratch / name);
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(back->view_names, three_views().view_names) << name;
    EXPECT_EQ(back->rows, 4);
    EXPECT_EQ(back->cols, 5);
    EXPECT_EQ(back->values, three_views().values) << name;
  }
}

TEST(ProjectionFile, RefusesAnNpyWithMoreViewsThanTheRigHasCameras) {
  const Scratch scratch;
  ASSERT_TRUE(write_projections(scratch / "p.npy", three_views(), {}));
  Rig rig;
  rig.cameras.resize(2);
  const auto back = read_projections(scratch / "p.npy", &rig);
  ASSERT_FALSE(back);
  EXPECT_NE(back.error().message.find("3 views"), std::string::npos) << back.error().message;
}

TEST(ProjectionFile, MatchesCamerasToViewsByName) {
  Rig rig;
  for (const char* name : {"cam02", "cam00", "spare", "cam01"}) {
    rig.cameras.emplace_back();
    rig.cameras.back().name = name;
  }
  const auto chosen = rig_of_views(rig, three_views(), "rig.yaml");
  ASSERT_TRUE(chosen);
  ASSERT_EQ(chosen->cameras.size(), 3u);
  EXPECT_EQ(chosen->cameras[2].name, "cam02");
  rig.cameras.pop_back();
  const auto missing = rig_of_views(rig, three_views(), "rig.yaml");
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().message.find("cam01"), std::string::npos);
}

TEST(ProjectionFile, CutShortOrDamagedIsAnErrorThatNamesTheFile) {
  const Scratch scratch;
  ASSERT_TRUE(write_projections(scratch / "whole.nxs", three_views(), {}));
  const std::string bytes = *read_text_file(scratch / "whole.nxs");
  for (std::size_t length = 0; length < bytes.size(); length += 1 + bytes.size() / 150) {
    overwrite(scratch / "cut.nxs", bytes.substr(0, length));
    const auto back = read_projections(scratch / "cut.nxs");
    ASSERT_FALSE(back) << length;
    EXPECT_NE(back.error().message.find("cut.nxs"), std::string::npos);
  }
  for (std::size_t at = 0; at < bytes.size(); at += 1 + bytes.size() / 400) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    overwrite(scratch / "cut.nxs", damaged);
    const auto back = read_projections(scratch / "cut.nxs");
    EXPECT_TRUE(!back || back->values == three_views().values) << "at " << at;
  }
}

}  // namespace
}  // namespace flamefield
