#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "acquire/action_trigger.h"
#include "acquire/arrival.h"
#include "acquire/buffer_pool.h"
#include "acquire/settings.h"
#include "proto/error.h"
#include "proto/frame.h"

namespace flamefield {

struct StreamStatistics {
  std::int64_t completed_frames = 0;
  std::int64_t failed_frames = 0;
  std::int64_t underruns = 0;  // packets that found no free buffer
  std::int64_t resent_packets = 0;
  std::int64_t missing_packets = 0;  // Aravis counts generously
};

// One GigE Vision camera through Aravis. Everything in one thread, the one that opened it; only is_lost()
// may be asked from others. Only the sources of this class know Aravis (aravis_*.cc, aravis_handles.h).
class AravisDevice {
 public:
  // Unavailable: no answer, another program has control, or a camera of another serial number is there.
  static Result<std::unique_ptr<AravisDevice>> open(const CameraAddress& address);
  ~AravisDevice();  // a camera that no longer answers makes this wait for some seconds
  AravisDevice(const AravisDevice&) = delete;
  AravisDevice& operator=(const AravisDevice&) = delete;

  // Sets and reads back every value. InvalidInput: the camera took something else, or has no such feature.
  Result<> apply(const CameraSettings& settings);

  // A new stream with fresh buffers (Aravis takes the frames of a restarted one for late).
  Result<> open_stream();
  Result<> start();
  void stop();
  StreamStatistics close_stream();

  // Edges of the trigger line since the last reset; none: the camera does not tell.
  std::optional<std::int64_t> trigger_count();
  bool reset_trigger_count();  // false: the camera has no such counter
  Result<> software_trigger();

  // What the camera sends, after apply().
  Result<FrameShape> shape();
  // Before it sends a frame, from the next frame on.
  Result<> set_frame_delay(std::int64_t delay_ns);
  // Its clock when the stream was opened; none: it cannot be read, or not kept by PTP.
  std::optional<SharedClock> shared_clock();

  // The next frame, or why a frame was lost; none within the timeout.
  std::optional<std::variant<Arrival, LossCause>> next(std::chrono::microseconds timeout);

  bool is_lost() const;  // the camera stopped answering
  const std::string& serial() const { return serial_; }

 private:
  struct Handles;
  explicit AravisDevice(std::unique_ptr<Handles> handles);

  bool has(const char* feature) const;
  Result<> set(const char* feature, std::int64_t value);
  Result<> set(const char* feature, std::string_view value);
  Result<> set_real(const char* feature, double value);
  Result<> configure_image(const CameraSettings& settings);
  Result<> configure_trigger(const CameraSettings& settings);
  Result<> configure_transport(const CameraSettings& settings);
  Result<> configure_chunks();
  void anchor_clock();
  std::int64_t utc_of(std::int64_t device_time_ns, std::int64_t arrival_ns);
  void push_buffer();

  std::unique_ptr<Handles> handles_;
  CameraSettings settings_;
  std::string serial_;
  bool has_counter_ = false;   // chunk with the trigger count
  bool has_exposure_ = false;  // chunk with the exposure time
  std::size_t payload_bytes_ = 0;
  BufferPool pool_{16};
  std::int64_t underruns_ = 0;
  std::optional<std::int64_t> clock_offset_ns_;  // UTC minus the camera's clock
  std::int64_t clock_error_ns_ = 0;
  bool is_clock_anchored_ = false;  // the offset was measured, not guessed from arrivals
};

}  // namespace flamefield
