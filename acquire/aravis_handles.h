// Shared by the sources of AravisDevice only: what they hold of Aravis.
#pragma once

#include <arv.h>

#include <atomic>
#include <mutex>
#include <string>
#include <string_view>

#include "acquire/aravis_device.h"

namespace flamefield {

// Aravis 0.8 parses GenICam files through static state: one at a time, or it mixes them up.
inline std::mutex genicam_parser;

// Collects Aravis' error; converts to bool when there was none.
class ArvError {
 public:
  ~ArvError() { g_clear_error(&error_); }
  GError** out() {
    g_clear_error(&error_);
    return &error_;
  }
  bool happened() const { return error_ != nullptr; }
  std::string text() const { return error_ ? error_->message : "no reason given"; }

 private:
  GError* error_ = nullptr;
};

struct AravisDevice::Handles {
  CameraAddress address;
  ArvCamera* camera = nullptr;
  ArvStream* stream = nullptr;
  ArvChunkParser* chunks = nullptr;
  std::atomic<bool> is_lost = false;

  ~Handles() {
    g_clear_object(&stream);
    g_clear_object(&chunks);
    g_clear_object(&camera);
  }
  tl::unexpected<Error> failed(const std::string& what, const ArvError& error) const {
    return unavailable(concat("camera ", address.name, " at ", address.address, ": ", what), error.text(),
                       "check its power, cable and address");
  }
  template <class T>
  tl::unexpected<Error> differs(std::string_view what, const T& wanted, const T& got) const {
    return invalid_input(concat("camera ", address.name, ": ", what, " ", wanted),
                         concat("it reads back ", got), "choose a value that the camera supports");
  }
  double tick_frequency_hz() const {
    ArvDevice* device = arv_camera_get_device(camera);
    return static_cast<double>(arv_gv_device_get_timestamp_tick_frequency(ARV_GV_DEVICE(device), nullptr));
  }
  bool has(const char* feature) const { return arv_camera_is_feature_available(camera, feature, nullptr); }
};

}  // namespace flamefield
