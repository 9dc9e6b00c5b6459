#pragma once

#include <netinet/in.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "acquire/simulator/faults.h"
#include "acquire/simulator/gvcp.h"
#include "acquire/simulator/gvsp.h"
#include "acquire/simulator/register_memory.h"
#include "acquire/simulator/scene.h"
#include "acquire/simulator/sensor.h"
#include "acquire/simulator/test_image.h"
#include "acquire/simulator/transmission.h"

namespace flamefield {

struct SimulatedCameraOptions {
  std::size_t number = 0;  // in the array
  std::string serial;
  std::string user_name;
  in_addr address{};  // its own, in network byte order
  std::string reported_address =
      {};  // what it says instead: somebody gave it another camera's; empty: its own
  int width_px = 659;
  int height_px = 494;
  std::int64_t clock_offset_ns = 0;  // the camera's clock at UTC 0 of the array
  double clock_drift_ppm = 0;
  bool has_ptp = false;              // it can keep the time of the network
  std::uint16_t first_frame_id = 1;  // after AcquisitionStart; the one after 65535 is 1
  double line_rate_bits_per_s = 0;   // of its network port; 0: as fast as it goes
  std::uint64_t seed = 1;
  SensorModel sensor;
};

struct SimulatedCameraCounters {
  std::int64_t edges = 0;            // on Line1 while the power was on
  std::int64_t missed = 0;           // no picture: a scripted fault, or still busy with earlier pulses
  std::int64_t frames = 0;           // pictures taken
  std::int64_t packets = 0;          // due on the wire
  std::int64_t dropped = 0;          // of these, lost by a scripted fault
  std::int64_t resent = 0;           // sent again on request
  std::int64_t commands = 0;         // well-formed control packets
  std::int64_t refused_packets = 0;  // control packets that make no sense
};

// One GigE Vision camera: registers, control protocol, and a thread that takes and sends pictures. The
// sockets' reader calls handle(), the signal generator trigger(); both return at once.
class SimulatedCamera {
 public:
  using SceneSource = std::function<Scene()>;

  // `stream_socket`: an open UDP socket bound to the camera's address, which the camera closes.
  SimulatedCamera(const SimulatedCameraOptions& options, SceneSource scene, int stream_socket);
  ~SimulatedCamera();
  SimulatedCamera(const SimulatedCamera&) = delete;
  SimulatedCamera& operator=(const SimulatedCamera&) = delete;

  // Answers one control packet; none when there is nothing to say. Call from one thread.
  std::optional<std::vector<std::uint8_t>> handle(std::span<const std::uint8_t> packet,
                                                  const sockaddr_in& from);
  // Gives the camera back when its client has been silent for longer than the heartbeat. Call now and then.
  void expire_control();
  // A rising edge on Line1.
  void trigger(const Pulse& pulse);

  void set_faults(const CameraFaults& faults);
  void set_power(bool on);  // off: mute, and everything that the client set is forgotten
  SimulatedCameraCounters counters() const;
  const SimulatedCameraOptions& options() const { return options_; }

 private:
  struct Order {
    Pulse pulse;
    std::uint32_t trigger_count = 0;
    std::int64_t exposure_ns = 0;  // UTC, when the exposure begins
  };
  struct Controller {
    in_addr_t address = 0;
    in_port_t port = 0;
    std::int64_t heard_ns = 0;
  };

  void reset_registers();
  void release_control();
  bool may_write(const sockaddr_in& from) const;
  GvcpStatus write_register(const RegisterWrite& write, const sockaddr_in& from);
  GvcpStatus write_memory(std::span<const std::uint8_t> payload, const sockaddr_in& from);
  void after_write(const RegisterWrite& write);
  void resend(const ResendRequest& request);
  void send_test_packet(std::uint32_t packet_size);
  void latch_clock();
  std::uint64_t ticks_at(std::int64_t time_ns) const;
  std::int64_t time_of(std::uint64_t ticks) const;

  void fit_region();
  void update_payload_size();
  void act(const ActionCommand& action);
  bool keeps_network_time() const;

  void follow_power_and_link(std::int64_t pulse);
  void count_and_order(Pulse pulse, std::uint32_t source);
  bool is_free_running() const;
  void run();
  std::optional<Order> next_order();
  Sensor::Readout readout() const;
  std::vector<std::uint8_t> expose(const Order& order);
  std::shared_ptr<StreamFrame> take_picture(const Order& order);
  void append_chunks(StreamFrame& frame, const Order& order) const;
  void transmit(std::shared_ptr<StreamFrame> frame);
  void send(const StreamFrame& frame);
  void pace(std::size_t packets, std::size_t bytes, std::chrono::steady_clock::time_point begin) const;
  Transmission transmission() const { return {faults_, options_.seed * 1000 + options_.number}; }
  sockaddr_in stream_destination() const;

  const SimulatedCameraOptions options_;
  const SceneSource scene_;
  const int stream_socket_;
  RegisterMemory registers_;
  const Sensor sensor_;
  std::atomic<std::int64_t> epoch_ns_;         // when the clock showed clock_offset_ns_
  std::atomic<std::int64_t> clock_offset_ns_;  // 0 after a power cut
  TestImage test_image_;                       // picture thread only
  std::optional<Controller> controller_;       // control thread only

  mutable std::mutex mutex_;  // what follows
  std::condition_variable wake_;
  std::deque<Order> orders_;
  std::deque<std::shared_ptr<const StreamFrame>> history_;  // for resend
  CameraFaults faults_;
  SimulatedCameraCounters counters_;
  std::uint32_t trigger_count_ = 0;  // since CounterReset
  std::uint16_t last_frame_id_ = 0;
  std::uint64_t resend_attempts_ = 0;
  bool quit_ = false;
  bool has_power_ = true;
  bool is_power_cut_ = false;  // by a scripted fault
  bool is_link_cut_ = false;
  std::thread thread_;
};

}  // namespace flamefield
