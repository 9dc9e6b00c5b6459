#include "acquire/simulator/simulated_array.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <thread>

#include "acquire/discovery.h"
#include "proto/utc.h"
#include "tests/acquire/array_fixture.h"

namespace flamefield {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(SimulatedArray, TakenPortIsNamedInTheError) {
  const auto first = SimulatedArray::open(small_array(2));
  ASSERT_TRUE(first) << first.error().message;
  const auto second = SimulatedArray::open(small_array(2));
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::Unavailable);
  EXPECT_THAT(second.error().message, AllOf(HasSubstr(first_test_address()), HasSubstr("3956")));
}

TEST(SimulatedArray, AddressesAreFreeAgainOnceItIsGone) {
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(SimulatedArray::open(small_array(2)));
}

TEST(SimulatedArray, BadOptionsAreRefusedByName) {
  SimulatedArrayOptions options = small_array(0);
  EXPECT_THAT(SimulatedArray::open(options).error().message, HasSubstr("cameras=0"));
  options = small_array(1);
  options.first_address = "127.0.0";
  EXPECT_THAT(SimulatedArray::open(options).error().message, HasSubstr("first_address=127.0.0"));
  options = small_array(1);
  options.width_px = 0;
  EXPECT_THAT(SimulatedArray::open(options).error().message, HasSubstr("0x48"));
  options = small_array(1);
  options.first_serial = "12x";
  EXPECT_THAT(SimulatedArray::open(options).error().message, HasSubstr("first_serial=12x"));
}

TEST(SimulatedArray, EveryCameraAnswersDiscoveryUnlessItsPowerIsOff) {
  const auto array = SimulatedArray::open(small_array(3));
  ASSERT_TRUE(array) << array.error().message;
  (*array)->set_power(1, false);
  const auto addresses = (*array)->addresses();
  EXPECT_TRUE(answers_discovery(addresses[0], std::chrono::milliseconds(600)));
  EXPECT_FALSE(answers_discovery(addresses[1], std::chrono::milliseconds(60)));
  EXPECT_TRUE(answers_discovery(addresses[2], std::chrono::milliseconds(600)));
  (*array)->set_power(1, true);
  EXPECT_TRUE(answers_discovery(addresses[1], std::chrono::milliseconds(600)));
}

// One edge is held up for twelve periods: those it delayed follow at once, and later ones are on time again.
// The least delay of them is judged, as any single one may suffer from a busy machine.
TEST(SignalGenerator, TrainKeepsItsScheduleHoweverLateAnEdgeIs) {
  constexpr std::int64_t kPeriod_ns = 5'000'000, kPulses = 40, kHeld = 5, kHold_ns = 12 * kPeriod_ns;
  std::vector<Pulse> pulses;
  SignalGenerator generator([&](const Pulse& pulse) {
    pulses.push_back(pulse);
    if (pulse.index == kHeld) std::this_thread::sleep_for(std::chrono::nanoseconds(kHold_ns));
  });
  const std::int64_t start_ns = utc_now_ns();
  generator.start(1e9 / kPeriod_ns, kPulses);
  ASSERT_TRUE(generator.wait_idle(std::chrono::seconds(30)));
  ASSERT_EQ(pulses.size(), static_cast<std::size_t>(kPulses));
  std::int64_t least_delay_ns = kHold_ns;
  for (std::int64_t i = 0; i < kPulses; ++i) {
    const Pulse& pulse = pulses[static_cast<std::size_t>(i)];
    EXPECT_EQ(pulse.number, i + 1);
    EXPECT_EQ(pulse.index, i);
    EXPECT_GE(pulse.time_ns, start_ns + i * kPeriod_ns - 1'000'000) << "two clocks may differ by a little";
    if (i > kPulses / 2)
      least_delay_ns = std::min(least_delay_ns, pulse.time_ns - pulses[0].time_ns - i * kPeriod_ns);
  }
  EXPECT_LT(least_delay_ns, kHold_ns / 2);
}

TEST(SignalGenerator, StopEndsAnEndlessTrainAndNumbersGoOn) {
  SignalGenerator generator([](const Pulse&) {});
  generator.start(1000, 0);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (generator.pulses() < 3 && std::chrono::steady_clock::now() < end) {
    generator.wait_idle(std::chrono::milliseconds(1));
  }
  generator.stop();
  EXPECT_FALSE(generator.is_running());
  const std::int64_t before = generator.pulses();
  EXPECT_GE(before, 3);
  EXPECT_GT(generator.fire().number, before - 1);
}

}  // namespace
}  // namespace flamefield
