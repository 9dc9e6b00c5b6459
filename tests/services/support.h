#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <random>
#include <string>
#include <thread>

#include "proto/codec.h"
#include "proto/message.h"
#include "services/bus/bus.h"
#include "tests/support/scratch.h"
#include "tests/support/slowdown.h"

// Small things that the tests of the bus, spool, ledger, dispatcher and worker share.
namespace flamefield::testing_support {

inline bool eventually(const std::function<bool()>& holds,
                       std::chrono::milliseconds deadline = std::chrono::seconds(10)) {
  const auto end = std::chrono::steady_clock::now() + kSlowdown * deadline;
  while (!holds()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

// A free TCP endpoint for a program that will come and go. Below the ports that Linux hands to outgoing
// connections: one of those may take such a port while its owner is away, even a client that keeps knocking.
inline std::string endpoint_to_keep(Bus& bus) {
  std::random_device random;
  for (int tries = 0; tries < 100; ++tries) {
    Router probe(bus);
    const std::string endpoint = concat("tcp://127.0.0.1:", 20'000 + random() % 12'000);
    if (probe.bind(endpoint)) return endpoint;
  }
  ADD_FAILURE() << "no free port between 20000 and 32000";
  return {};
}

// Set `index` of a capture: two cameras, a third one lost, pixels that tell the set.
inline FrameSet make_set(const std::string& capture, std::int64_t index, int side_px = 8,
                         CaptureKind kind = CaptureKind::Burst) {
  FrameSet set;
  set.capture = capture;
  set.kind = kind;
  set.index = index;
  set.pulse = index + 100;
  set.pulse_time_ns = 1'700'000'000'000'000'000 + index * 200'000'000;
  set.complete_time_ns = set.pulse_time_ns + 5'000'000;
  for (int camera = 0; camera < 2; ++camera) {
    Frame frame;
    frame.camera = "cam0" + std::to_string(camera);
    frame.pulse = set.pulse;
    frame.width_px = frame.height_px = side_px;
    const auto pixels = static_cast<std::size_t>(side_px) * static_cast<std::size_t>(side_px);
    frame.bytes = std::make_shared<const std::vector<std::byte>>(
        pixels, static_cast<std::byte>((index * 2 + camera) & 255));
    set.frames.push_back(frame);
  }
  set.losses.push_back({"cam02", LossCause::Incomplete});
  return set;
}

inline bool same_pixels(const FrameSet& a, const FrameSet& b) {
  if (a.frames.size() != b.frames.size()) return false;
  for (std::size_t i = 0; i < a.frames.size(); ++i) {
    if (!a.frames[i].bytes || !b.frames[i].bytes || *a.frames[i].bytes != *b.frames[i].bytes) return false;
  }
  return encode(PutSet{a}) == encode(PutSet{b});
}

inline Rig make_rig() {
  Rig rig;
  for (int i = 0; i < 3; ++i) {
    Camera camera;
    camera.name = "cam0" + std::to_string(i);
    camera.image_width_px = camera.image_height_px = 8;
    camera.fx_px = camera.fy_px = 40;
    camera.cx_px = camera.cy_px = 3.5;
    camera.camera_from_world.translation_mm = {0, 0, 300.0 + i};
    rig.cameras.push_back(camera);
  }
  return rig;
}

inline Processing make_processing() {
  Processing processing;
  processing.rig_id = fingerprint(make_rig());
  processing.grid = centred_grid(4, 4, 4, 1);
  return processing;
}

}  // namespace flamefield::testing_support
