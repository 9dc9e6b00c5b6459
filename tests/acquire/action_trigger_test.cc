#include "acquire/action_trigger.h"

#include <gmock/gmock.h>

#include "acquire/simulator/gvcp.h"
#include "tests/acquire/array_fixture.h"

namespace flamefield {
namespace {

TEST(ActionTrigger, CommandIsWhatADeviceDecodes) {
  const ActionKeys keys{0x01020304, 0x05060708, 0x090a0b0c};
  const auto at_once = encode_action(keys, 7, std::nullopt);
  auto command = decode_gvcp(at_once);
  ASSERT_TRUE(command);
  EXPECT_EQ(command->code, GvcpCode::Action);
  EXPECT_EQ(command->request_id, 7);
  EXPECT_FALSE(command->wants_acknowledge);
  auto action = decode_action(*command);
  ASSERT_TRUE(action);
  EXPECT_EQ(action->device_key, keys.device_key);
  EXPECT_EQ(action->group_key, keys.group_key);
  EXPECT_EQ(action->group_mask, keys.group_mask);
  EXPECT_FALSE(action->ticks);

  const auto later = encode_action(keys, 8, 0x123456789abcdef0);
  command = decode_gvcp(later);
  ASSERT_TRUE(command);
  EXPECT_EQ(decode_action(*command)->ticks, 0x123456789abcdef0u);
}

TEST(ActionTrigger, ClocksAreSharedOnlyWhenTheyAgreeWithinTheirErrors) {
  EXPECT_FALSE(agreed_clock({}));
  EXPECT_EQ(agreed_clock({{100, 5, 1e9}, {103, 5, 1e9}, {101, 5, 1e9}})->ahead_ns, 101);
  EXPECT_FALSE(agreed_clock({{0, 5'000, 1e9}, {20'000'000, 5'000, 1e9}}));
  EXPECT_FALSE(agreed_clock({{100, 5, 1e9}, {100, 5, 125e6}})) << "one command has one number of ticks";
}

TEST(ActionTrigger, AddressesThatAreNoneAreRefused) {
  EXPECT_FALSE(ActionTrigger::open({"cam00"}, {}));
  ActionKeys keys;
  keys.broadcast_address = "192.168.7";
  EXPECT_FALSE(ActionTrigger::open({"127.0.0.2"}, keys));
}

TEST_F(CameraArrayTest, ActionCommandOfOtherKeysFiresNobody) {
  CameraSettings settings;
  settings.trigger_source = "Action1";
  settings.action = ActionKeys{1, 2, 4};
  open(small_array(2), settings);
  SetCollector collector;
  ASSERT_TRUE(array_->start({.capture = "test"}, collector.handler()));
  for (const ActionKeys& keys :
       {ActionKeys{9, 2, 4}, ActionKeys{1, 9, 4}, ActionKeys{1, 2, 8}, ActionKeys{1, 2, 6}}) {
    auto trigger = ActionTrigger::open(array_->addresses(), keys);
    ASSERT_TRUE(trigger) << trigger.error().message;
    (*trigger)->start(1000, 1);
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
    while ((*trigger)->fired() < 1 && std::chrono::steady_clock::now() < end)
      array_->wait_done(std::chrono::milliseconds(1));
  }
  report_ = array_->stop();  // asks every camera what it has counted, after all commands
  EXPECT_EQ(collector.take().size(), 1u) << "the last one shares a bit of the mask";
}

TEST_F(CameraArrayTest, OnlyCamerasThatKeepTheNetworksTimeHaveACommonClock) {
  SimulatedArrayOptions options = small_array(3);
  options.has_ptp = true;
  open(options);
  SetCollector collector;
  ASSERT_TRUE(array_->start({.capture = "test"}, collector.handler()));
  const auto clock = array_->common_clock();
  array_->stop();
  ASSERT_TRUE(clock);
  EXPECT_NEAR(static_cast<double>(clock->ahead_ns), 37e9, 5e6) << "PTP keeps TAI";
  array_.reset();
  simulated_.reset();
  open(small_array(3));
  ASSERT_TRUE(array_->start({.capture = "test"}, collector.handler()));
  EXPECT_FALSE(array_->common_clock());
  array_->stop();
}

}  // namespace
}  // namespace flamefield
