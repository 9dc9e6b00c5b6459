#include "acquire/simulator/simulated_array.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <random>

#include "proto/camera_name.h"
#include "proto/check.h"

namespace flamefield {

namespace {

constexpr std::uint16_t kControlPort = 3956;  // fixed by GigE Vision
constexpr int kHeartbeatCheck_ms = 250;
constexpr int kSendBuffer_bytes = 4 << 20;

sockaddr_in endpoint(in_addr address, std::uint16_t port) {
  sockaddr_in out{};
  out.sin_family = AF_INET;
  out.sin_port = htons(port);
  out.sin_addr = address;
  return out;
}

std::string text_of(in_addr address) {
  std::array<char, INET_ADDRSTRLEN> text{};
  inet_ntop(AF_INET, &address, text.data(), text.size());
  return text.data();
}

// `mode`: SOCK_NONBLOCK for a socket that is polled, 0 for one whose writer waits for room.
Result<int> bound_socket(in_addr address, std::uint16_t port, int mode) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | mode, 0);
  const sockaddr_in local = endpoint(address, port);
  if (fd < 0 || ::bind(fd, reinterpret_cast<const sockaddr*>(&local), sizeof local) != 0) {
    const int error = errno;
    if (fd >= 0) ::close(fd);
    return unavailable(concat("cannot listen on ", text_of(address), " port ", port), std::strerror(error),
                       "stop the program that uses it, or choose another first address, e.g. 127.0.1.2");
  }
  return fd;
}

Result<std::uint64_t> first_serial(const SimulatedArrayOptions& options) {
  std::uint64_t serial = 0;
  const std::string& text = options.first_serial;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), serial);
  if (error != std::errc() || end != text.data() + text.size() || text.size() > 12) {
    return invalid_input(concat("first_serial=", text), "must be a decimal number of at most 12 digits",
                         "use e.g. 21000000");
  }
  return serial;
}

}  // namespace

Result<std::unique_ptr<SimulatedArray>> SimulatedArray::open(const SimulatedArrayOptions& options) {
  if (options.cameras == 0 || options.cameras > 250) {
    return invalid_input(concat("cameras=", options.cameras), "must be 1 to 250",
                         "choose a number in this range");
  }
  if (options.width_px < 1 || options.height_px < 1 || options.width_px > 8192 || options.height_px > 8192) {
    return invalid_input(concat("sensor of ", options.width_px, "x", options.height_px, " px"),
                         "each side must be 1 to 8192 px", "use e.g. 659x494");
  }
  std::unique_ptr<SimulatedArray> array(new SimulatedArray);
  array->endpoints_.reserve(options.cameras);
  for (std::size_t i = 0; i < options.cameras; ++i) {
    if (auto added = array->add_camera(options, i); !added) return tl::unexpected(added.error());
  }
  if (options.answers_broadcasts) {
    auto socket = bound_socket(in_addr{INADDR_BROADCAST}, kControlPort, SOCK_NONBLOCK);
    if (!socket) return tl::unexpected(socket.error());
    array->broadcast_socket_ = *socket;
  }
  array->wake_event_ = ::eventfd(0, EFD_CLOEXEC);
  array->control_thread_ = std::thread([raw = array.get()] { raw->serve(); });
  array->generator_ = std::make_unique<SignalGenerator>([raw = array.get()](const Pulse& pulse) {
    if (raw->observer_) raw->observer_(pulse);
    for (const Endpoint& endpoint : raw->endpoints_) endpoint.camera->trigger(pulse);
  });
  return array;
}

Result<> SimulatedArray::add_camera(const SimulatedArrayOptions& options, std::size_t number) {
  in_addr first{};
  if (inet_pton(AF_INET, options.first_address.c_str(), &first) != 1) {
    return invalid_input(concat("first_address=", options.first_address), "is not an IPv4 address",
                         "use e.g. 127.0.0.2");
  }
  const auto serial = first_serial(options);
  if (!serial) return tl::unexpected(serial.error());
  const in_addr address{htonl(ntohl(first.s_addr) + static_cast<std::uint32_t>(number))};
  auto control = bound_socket(address, kControlPort, SOCK_NONBLOCK);
  if (!control) return tl::unexpected(control.error());
  endpoints_.push_back({*control, text_of(address), nullptr});
  auto stream = bound_socket(address, 0, 0);
  if (!stream) return tl::unexpected(stream.error());
  ::setsockopt(*stream, SOL_SOCKET, SO_SNDBUF, &kSendBuffer_bytes, sizeof kSendBuffer_bytes);

  std::mt19937_64 random(options.seed * 7919 + number);
  SimulatedCameraOptions camera;
  camera.number = number;
  camera.serial = std::to_string(*serial + number);
  camera.user_name = camera_name(number);
  camera.address = address;
  camera.width_px = options.width_px;
  camera.height_px = options.height_px;
  camera.clock_offset_ns = static_cast<std::int64_t>(
      1e9 * std::uniform_real_distribution<double>(0, options.max_clock_offset_s)(random));
  camera.clock_drift_ppm = std::uniform_real_distribution<double>(-options.max_clock_drift_ppm,
                                                                  options.max_clock_drift_ppm)(random);
  camera.has_ptp = options.has_ptp;
  camera.reported_address = options.reported_address;
  camera.first_frame_id = options.first_frame_id;
  camera.line_rate_bits_per_s = options.line_rate_bits_per_s;
  camera.seed = options.seed;
  camera.sensor = options.sensor;
  const auto scene = [this] {
    const std::lock_guard lock(scene_mutex_);
    return scene_;
  };
  endpoints_.back().camera = std::make_unique<SimulatedCamera>(camera, scene, *stream);
  return {};
}

SimulatedArray::~SimulatedArray() {
  generator_.reset();  // first: it calls the cameras
  if (control_thread_.joinable()) {
    const std::uint64_t one = 1;
    expect(::write(wake_event_, &one, sizeof one) == sizeof one, "an eventfd takes a count");
    control_thread_.join();
  }
  for (Endpoint& endpoint : endpoints_) {
    endpoint.camera.reset();
    ::close(endpoint.socket);
  }
  if (broadcast_socket_ >= 0) ::close(broadcast_socket_);
  if (wake_event_ >= 0) ::close(wake_event_);
}

void SimulatedArray::serve() {
  std::vector<pollfd> sockets;
  for (const Endpoint& endpoint : endpoints_) sockets.push_back({endpoint.socket, POLLIN, 0});
  if (broadcast_socket_ >= 0) sockets.push_back({broadcast_socket_, POLLIN, 0});
  sockets.push_back({wake_event_, POLLIN, 0});
  for (;;) {
    const int ready = ::poll(sockets.data(), sockets.size(), kHeartbeatCheck_ms);
    if (sockets.back().revents != 0) return;
    if (ready <= 0) {
      for (const Endpoint& endpoint : endpoints_) endpoint.camera->expire_control();
      continue;
    }
    for (const pollfd& socket : sockets) {
      if (socket.revents != 0) receive(socket.fd);
    }
  }
}

void SimulatedArray::receive(int socket) {
  std::array<std::uint8_t, 2048> bytes;  // GVCP packets are at most 576 bytes long
  for (;;) {
    sockaddr_in from{};
    socklen_t length = sizeof from;
    const ssize_t size =
        ::recvfrom(socket, bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&from), &length);
    if (size < 0) return;
    const std::span packet(bytes.data(), static_cast<std::size_t>(size));
    for (const Endpoint& endpoint : endpoints_) {
      if (socket != endpoint.socket && socket != broadcast_socket_) continue;
      if (const auto reply = endpoint.camera->handle(packet, from)) {
        ::sendto(endpoint.socket, reply->data(), reply->size(), 0, reinterpret_cast<const sockaddr*>(&from),
                 length);
      }
    }
  }
}

std::vector<std::string> SimulatedArray::names() const {
  std::vector<std::string> out;
  for (const Endpoint& endpoint : endpoints_) out.push_back(endpoint.camera->options().user_name);
  return out;
}

std::vector<std::string> SimulatedArray::addresses() const {
  std::vector<std::string> out;
  for (const Endpoint& endpoint : endpoints_) out.push_back(endpoint.address);
  return out;
}

std::vector<std::string> SimulatedArray::serials() const {
  std::vector<std::string> out;
  for (const Endpoint& endpoint : endpoints_) out.push_back(endpoint.camera->options().serial);
  return out;
}

void SimulatedArray::set_scene(Scene scene) {
  const std::lock_guard lock(scene_mutex_);
  scene_ = std::move(scene);
}

void SimulatedArray::set_faults(std::size_t camera, const CameraFaults& faults) {
  expect(camera < endpoints_.size(), "the array has this camera");
  endpoints_[camera].camera->set_faults(faults);
}

void SimulatedArray::set_power(std::size_t camera, bool on) {
  expect(camera < endpoints_.size(), "the array has this camera");
  endpoints_[camera].camera->set_power(on);
}

SimulatedCameraCounters SimulatedArray::counters(std::size_t camera) const {
  expect(camera < endpoints_.size(), "the array has this camera");
  return endpoints_[camera].camera->counters();
}

}  // namespace flamefield
