#include "services/recording/recording.h"

#include <gmock/gmock.h>

#include "services/dispatcher/dispatcher.h"
#include "services/ledger/reader.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using namespace testing_support;
using namespace std::chrono_literals;

SetSource made_sets(int* asked = nullptr) {
  return [asked](std::int64_t index) -> Result<FrameSet> {
    if (asked) ++*asked;
    return make_set("burst", index);
  };
}

const RecordingProgress kQuiet = [](std::int64_t, std::int64_t) {};

TEST(Recording, HoldsEverySetOfTheCaptureWithItsLosses) {
  const Scratch scratch;
  const auto done = convert_capture(made_sets(), 40, scratch / "burst.nxs", {{"who", "test"}}, kQuiet, {});
  ASSERT_TRUE(done) << done.error().message;
  const auto reader = FrameReader::open(scratch / "burst.nxs");
  ASSERT_TRUE(reader) << reader.error().message;
  ASSERT_EQ(reader->sets(), 40u);
  for (std::size_t i = 0; i < 40; ++i) {
    const auto set = reader->read(i);
    ASSERT_TRUE(set) << set.error().message;
    EXPECT_TRUE(same_pixels(*set, make_set("burst", static_cast<std::int64_t>(i)))) << i;
  }
  EXPECT_EQ(scratch.entries(), 1u) << "no parts are left";
}

TEST(Recording, ConversionGoesOnWhereItWasInterrupted) {
  const Scratch scratch;
  int asked = 0;
  const auto interrupted = convert_capture(
      [&](std::int64_t index) -> Result<FrameSet> {
        if (index == 37) return unavailable("power", "cut", "");
        ++asked;
        return make_set("burst", index);
      },
      50, scratch / "burst.nxs", {}, kQuiet, {});
  EXPECT_FALSE(interrupted);
  EXPECT_FALSE(std::filesystem::exists(scratch / "burst.nxs"));
  EXPECT_EQ(asked, 37);
  asked = 0;
  const auto done = convert_capture(made_sets(&asked), 50, scratch / "burst.nxs", {}, kQuiet, {});
  ASSERT_TRUE(done) << done.error().message;
  EXPECT_EQ(asked, 18) << "two blocks of 16 were kept";
  EXPECT_EQ(FrameReader::open(scratch / "burst.nxs")->sets(), 50u);
}

TEST(Recording, BecomesOneTiffAPicture) {
  const Scratch scratch;
  ASSERT_TRUE(convert_capture(made_sets(), 3, scratch / "burst.nxs", {}, kQuiet, {}));
  const auto ok = write_frame_tiffs(scratch / "pictures", *FrameReader::open(scratch / "burst.nxs"));
  ASSERT_TRUE(ok) << ok.error().message;
  for (const char* name : {"cam00/burst-000000.tif", "cam01/burst-000002.tif", "sets.csv"})
    EXPECT_TRUE(std::filesystem::exists(scratch.path() / "pictures" / name)) << name;
}

TEST(Recording, ReplayedGoesThroughTheDispatcherLikeACapture) {
  const Scratch scratch;
  ASSERT_TRUE(convert_capture(made_sets(), 20, scratch / "burst.nxs", {}, kQuiet, {}));
  const auto recording = FrameReader::open(scratch / "burst.nxs");
  ASSERT_TRUE(recording);
  const KeyRing keys = KeyRing::open_or_create(scratch / "keys").value();
  Bus bus(keys);
  auto dispatcher =
      Dispatcher::open(bus, {.data_dir = scratch / "data", .endpoints = {"inproc://dispatcher"}});
  ASSERT_TRUE(dispatcher) << dispatcher.error().message;
  std::jthread service([&](std::stop_token stop) { EXPECT_TRUE((*dispatcher)->run(stop)); });
  const auto report =
      replay(*recording, bus, "inproc://dispatcher", {.capture = "again", .keeps_time = false}, kQuiet, {});
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_EQ(report->sets, 20);
  auto reader = LedgerReader::open(scratch / "data");
  ASSERT_TRUE(reader) << reader.error().message;
  const auto sets = reader->sets("again");
  ASSERT_TRUE(sets);
  EXPECT_EQ(sets->size(), 20u);
}

}  // namespace
}  // namespace flamefield
