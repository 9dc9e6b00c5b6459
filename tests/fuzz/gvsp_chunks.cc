#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>
#include <string>

#include "acquire/aravis_device.h"
#include "acquire/discovery.h"
#include "acquire/simulator/gvsp.h"
#include "acquire/simulator/simulated_array.h"
#include "tests/fuzz/targets.h"

namespace flamefield::fuzz {

namespace {

using namespace std::chrono_literals;

constexpr std::uint32_t kStreamPort = 0x0d00;  // bootstrap register, GigE Vision 2.0
constexpr int kSide_px = 8;

// A camera that our client has opened and waits for; what it sends comes from here instead.
class HostileCamera {
 public:
  HostileCamera() {
    SimulatedArrayOptions options;
    options.cameras = 1;
    options.width_px = options.height_px = kSide_px;
    const auto pid = static_cast<unsigned>(::getpid());
    options.first_address = concat("127.", 70 + (pid >> 8) % 100, ".", pid & 255, ".2");
    auto array = SimulatedArray::open(options);
    if (!array) std::abort();
    array_ = std::move(*array);
    const std::string address = array_->addresses()[0];
    auto device = AravisDevice::open({"cam00", address});
    if (!device || !(*device)->apply({.buffers = 8}) || !(*device)->open_stream() || !(*device)->start())
      std::abort();
    device_ = std::move(*device);
    to_.sin_family = AF_INET;
    to_.sin_port =
        htons(static_cast<std::uint16_t>(read_bootstrap_register(address, kStreamPort, 1s).value()));
    to_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socket_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sockaddr_in from = to_;
    from.sin_port = 0;
    inet_pton(AF_INET, address.c_str(), &from.sin_addr);
    if (::bind(socket_, reinterpret_cast<const sockaddr*>(&from), sizeof from) != 0) std::abort();
  }
  ~HostileCamera() { ::close(socket_); }
  HostileCamera(const HostileCamera&) = delete;
  HostileCamera& operator=(const HostileCamera&) = delete;

  void send(Bytes packet) {
    ::sendto(socket_, packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&to_), sizeof to_);
  }
  // A sound picture whose chunks are these bytes.
  void send_chunks(Bytes chunks) {
    StreamFrame frame;
    frame.frame_id = next_id_ = static_cast<std::uint16_t>(next_id_ == 65535 ? 1 : next_id_ + 1);
    frame.timestamp = 1000;
    frame.pixel_format = 0x01080001;  // Mono8
    frame.width_px = frame.height_px = kSide_px;
    frame.has_chunks = true;
    frame.packet_payload = 1400;
    frame.payload.assign(kSide_px * kSide_px, 7);
    frame.payload.insert(frame.payload.end(), chunks.begin(), chunks.end());
    for (std::uint32_t i = 0; i < frame.packets(); ++i) {
      std::vector<std::uint8_t> packet;
      encode_packet(frame, i, packet);
      send(packet);
    }
  }
  // What our client makes of it.
  void judge() {
    while (const auto next = device_->next(500us)) {
      const auto* arrival = std::get_if<Arrival>(&*next);
      if (!arrival) continue;
      const Frame& frame = arrival->frame;
      if (!frame.bytes ||
          frame.bytes->size() != bytes_of_image(frame.format, frame.width_px, frame.height_px) ||
          !grey_levels(frame))
        std::abort();
    }
  }

 private:
  std::unique_ptr<SimulatedArray> array_;
  std::unique_ptr<AravisDevice> device_;
  sockaddr_in to_{};
  int socket_ = -1;
  std::uint16_t next_id_ = 0;
};

}  // namespace

void gvsp_chunks(Bytes bytes) {
  // Never destroyed: the library's own threads and statics end first.
  static HostileCamera& camera = *new HostileCamera;
  camera.send_chunks(bytes);
  camera.judge();
}

}  // namespace flamefield::fuzz
