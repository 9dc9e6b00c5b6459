#include "acquire/gige_camera.h"

#include <gtest/gtest.h>

#include <condition_variable>
#include <mutex>
#include <thread>

#include "tests/acquire/array_fixture.h"

namespace flamefield {
namespace {

using std::chrono::seconds;

// A reader that holds the camera's thread up while frames come.
TEST(GigeCamera, FramesThatFindNoBufferAreNamedAndCounted) {
  const auto simulated = SimulatedArray::open(small_array(1));
  ASSERT_TRUE(simulated) << simulated.error().message;
  CameraSettings settings;
  settings.buffers = 2;
  GigeCamera camera({"cam00", (*simulated)->addresses()[0]}, settings);
  ASSERT_TRUE(camera.open().get());
  std::mutex mutex;
  std::condition_variable changed;
  bool is_held = true;
  int frames = 0, no_buffer = 0;
  GigeCamera::Events events;
  events.on_frame = [&](const Arrival&) {
    std::unique_lock lock(mutex);
    ++frames;
    changed.notify_all();
    changed.wait_for(lock, seconds(20), [&] { return !is_held; });
  };
  events.on_loss = [&](LossCause cause) {
    const std::lock_guard lock(mutex);
    no_buffer += cause == LossCause::NoBuffer ? 1 : 0;
    changed.notify_all();
  };
  events.on_camera_lost = [] {};
  ASSERT_TRUE(camera.arm(events).get());
  ASSERT_TRUE(camera.start().get());
  (*simulated)->generator().start(100, 12);
  ASSERT_TRUE((*simulated)->generator().wait_idle(testing_support::kSlowdown * seconds(5)));
  const auto end = std::chrono::steady_clock::now() + seconds(10);
  while ((*simulated)->counters(0).frames < 12 && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  std::unique_lock lock(mutex);
  is_held = false;
  changed.notify_all();
  EXPECT_TRUE(changed.wait_for(lock, seconds(10), [&] { return no_buffer > 0; }));
  EXPECT_GT(frames, 0);
  EXPECT_LT(frames, 12);
  lock.unlock();
  EXPECT_GT(camera.stop().get().underruns, 0);
}

}  // namespace
}  // namespace flamefield
