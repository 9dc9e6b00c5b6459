#include "acquire/simulator/simulated_array.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include "acquire/discovery.h"
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

TEST(SignalGenerator, TrainKeepsItsScheduleHoweverLateAnEdgeIs) {
  std::vector<Pulse> pulses;
  SignalGenerator generator([&](const Pulse& pulse) { pulses.push_back(pulse); });
  generator.start(200, 40);
  ASSERT_TRUE(generator.wait_idle(std::chrono::seconds(5)));
  ASSERT_EQ(pulses.size(), 40u);
  for (std::size_t i = 0; i < pulses.size(); ++i) {
    EXPECT_EQ(pulses[i].number, static_cast<std::int64_t>(i) + 1);
    EXPECT_EQ(pulses[i].index, static_cast<std::int64_t>(i));
    EXPECT_GE(pulses[i].time_ns, pulses[0].time_ns + static_cast<std::int64_t>(i) * 5'000'000 - 3'000'000);
  }
  EXPECT_LT(pulses.back().time_ns - pulses.front().time_ns, 39 * 5'000'000 + 100'000'000);
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
