// Independent proof: the client against the GigE Vision camera that Aravis itself simulates.
#include <arv.h>
#include <gtest/gtest.h>

#include "acquire/camera_array.h"
#include "tests/acquire/array_fixture.h"

namespace flamefield {
namespace {

TEST(AravisFakeCamera, DeliversASetForEachSoftwareTrigger) {
  const std::string address = "127.0.0.1";  // it binds to an address that an interface has
  ArvGvFakeCamera* fake = arv_gv_fake_camera_new(address.c_str(), "fake-1");
  const bool is_running = arv_gv_fake_camera_is_running(fake);
  if (!is_running) {
    g_object_unref(fake);
    GTEST_SKIP() << "port 3956 of 127.0.0.1 is in use";
  }
  {
    CameraSettings settings;
    settings.trigger_source = "Software";
    settings.region = SensorRegion{0, 0, 128, 96};
    settings.exposure_us = 1000;
    auto array = CameraArray::open({{"cam00", address}}, settings);
    ASSERT_TRUE(array) << array.error().message;
    SetCollector collector;
    const auto started = (*array)->start({.capture = "fake", .pulses = 3}, collector.handler());
    ASSERT_TRUE(started) << started.error().message;
    for (std::int64_t i = 0; i < 3; ++i) {
      ASSERT_TRUE((*array)->software_trigger());
      const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
      while ((*array)->progress().sets <= i && std::chrono::steady_clock::now() < end) {
        (*array)->wait_done(std::chrono::milliseconds(5));
      }
    }
    const CaptureReport report = (*array)->stop();
    const auto sets = collector.take();
    expect_balanced(report, sets);
    ASSERT_EQ(sets.size(), 3u);
    for (const FrameSet& set : sets) {
      ASSERT_EQ(set.frames.size(), 1u);
      EXPECT_EQ(set.frames[0].width_px, 128);
      EXPECT_EQ(set.frames[0].bytes->size(), 128u * 96u);
    }
  }
  g_object_unref(fake);
}

}  // namespace
}  // namespace flamefield
