#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "acquire/simulator/faults.h"
#include "acquire/simulator/scene.h"
#include "acquire/simulator/sensor.h"
#include "acquire/simulator/signal_generator.h"
#include "acquire/simulator/simulated_camera.h"
#include "proto/error.h"

namespace flamefield {

struct SimulatedArrayOptions {
  std::size_t cameras = 15;
  int width_px = 659;
  int height_px = 494;
  std::string first_address = "127.0.0.2";  // the others follow; every 127.x.y.z is this machine, no set-up
  std::string first_serial = "21000000";    // decimal, the others follow
  std::uint64_t seed = 1;                   // of noise, defects, clocks and packet loss
  double max_clock_offset_s = 100;          // each camera's clock starts somewhere in [0, this]
  double max_clock_drift_ppm = 50;          // and drifts by [-this, this]
  bool has_ptp = false;                     // cameras can keep the network's time
  std::string
      reported_address;  // all cameras say that they are at this one: an address used twice; empty: no
  std::uint16_t first_frame_id = 1;  // of every camera
  double line_rate_bits_per_s = 0;   // of each camera's port; 0: as fast as it goes
  bool answers_broadcasts = false;   // discovery from other programs; one array a machine can
  SensorModel sensor;
};

// N real GigE Vision cameras on the loopback interface and the signal generator wired to their Line1.
class SimulatedArray {
 public:
  // InvalidInput: bad options. Unavailable: an address and port are in use, or not ours.
  static Result<std::unique_ptr<SimulatedArray>> open(const SimulatedArrayOptions& options);
  ~SimulatedArray();
  SimulatedArray(const SimulatedArray&) = delete;
  SimulatedArray& operator=(const SimulatedArray&) = delete;

  std::vector<std::string> names() const;  // cam00, cam01, ...
  std::vector<std::string> addresses() const;
  std::vector<std::string> serials() const;

  // What the cameras see from the next pulse on. Any thread, any time.
  void set_scene(Scene scene);
  SignalGenerator& generator() { return *generator_; }
  // Called at every edge, before the cameras see it; must return at once. Set it while no pulse comes.
  void on_edge(std::function<void(const Pulse&)> observer) { observer_ = std::move(observer); }

  void set_faults(std::size_t camera, const CameraFaults& faults);
  void set_power(std::size_t camera, bool on);
  SimulatedCameraCounters counters(std::size_t camera) const;

 private:
  struct Endpoint {
    int socket = -1;
    std::string address;
    std::unique_ptr<SimulatedCamera> camera;
  };
  SimulatedArray() = default;
  Result<> add_camera(const SimulatedArrayOptions& options, std::size_t number);
  void serve();
  void receive(int socket);

  mutable std::mutex scene_mutex_;
  Scene scene_;
  std::vector<Endpoint> endpoints_;
  std::function<void(const Pulse&)> observer_;
  int broadcast_socket_ = -1;
  int wake_event_ = -1;
  std::thread control_thread_;
  std::unique_ptr<SignalGenerator> generator_;
};

}  // namespace flamefield
