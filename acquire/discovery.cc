#include "acquire/discovery.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <span>

namespace flamefield {

namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;
using Command = std::span<const std::uint8_t>;
using Reply = std::array<std::uint8_t, 576>;

constexpr std::uint16_t kControlPort = 3956;
constexpr int kTries = 3;
constexpr milliseconds kSearchWait{1000}, kTwinWait{400};
constexpr std::size_t kHeader = 8, kDiscoverySize = 0xf8;
// Key, acknowledge please, DISCOVERY, no payload, request id 1: GigE Vision 2.0, section 14.
constexpr std::array<std::uint8_t, 8> kDiscovery = {0x42, 0x01, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01};
// Any device may answer, by broadcast if it is in another subnet.
constexpr std::array<std::uint8_t, 8> kDiscoveryBroadcast = {0x42, 0x11, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01};

class UdpSocket {
 public:
  UdpSocket() : fd_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {}
  UdpSocket(const UdpSocket&) = delete;
  UdpSocket(UdpSocket&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  ~UdpSocket() {
    if (fd_ >= 0) ::close(fd_);
  }
  int fd() const { return fd_; }

 private:
  int fd_;
};

sockaddr_in control_endpoint(in_addr address) {
  sockaddr_in out{};
  out.sin_family = AF_INET;
  out.sin_port = htons(kControlPort);
  out.sin_addr = address;
  return out;
}

bool is_acknowledge(const Reply& reply, ssize_t size, std::uint8_t code) {
  return size >= 8 && reply[0] == 0 && reply[1] == 0 && reply[2] == 0x00 && reply[3] == code &&
         reply[6] == 0 && reply[7] == 1;
}

// Sends up to three times; the size of the acknowledge, or none.
std::optional<std::size_t> ask(const std::string& address, Command command, milliseconds timeout,
                               Reply& reply) {
  in_addr to{};
  if (inet_pton(AF_INET, address.c_str(), &to) != 1) return std::nullopt;
  const sockaddr_in endpoint = control_endpoint(to);
  const UdpSocket socket;
  // Connected, so that only the device's own answers come through, and "nobody there" comes at once.
  if (socket.fd() < 0 ||
      ::connect(socket.fd(), reinterpret_cast<const sockaddr*>(&endpoint), sizeof endpoint) != 0) {
    return std::nullopt;
  }
  const auto code = static_cast<std::uint8_t>(command[3] + 1);
  for (int i = 0; i < kTries; ++i) {
    if (::send(socket.fd(), command.data(), command.size(), 0) < 0) return std::nullopt;
    pollfd readable{socket.fd(), POLLIN, 0};
    if (::poll(&readable, 1, static_cast<int>(timeout.count()) / kTries) <= 0) continue;
    const ssize_t size = ::recv(socket.fd(), reply.data(), reply.size(), 0);
    if (is_acknowledge(reply, size, code)) return static_cast<std::size_t>(size);
  }
  return std::nullopt;
}

std::string text_at(const std::uint8_t* bytes, std::size_t size) {
  const auto* end = std::find(bytes, bytes + size, std::uint8_t{0});
  return {bytes, end};
}

// One socket for each interface that is up, asking already.
std::vector<UdpSocket> broadcast_everywhere() {
  std::vector<UdpSocket> out;
  ifaddrs* interfaces = nullptr;
  if (::getifaddrs(&interfaces) != 0) return out;
  for (const ifaddrs* entry = interfaces; entry; entry = entry->ifa_next) {
    if (!entry->ifa_addr || entry->ifa_addr->sa_family != AF_INET || (entry->ifa_flags & IFF_UP) == 0)
      continue;
    UdpSocket socket;
    sockaddr_in local = *reinterpret_cast<const sockaddr_in*>(entry->ifa_addr);
    local.sin_port = 0;
    const int on = 1;
    ::setsockopt(socket.fd(), SOL_SOCKET, SO_BROADCAST, &on, sizeof on);
    if (::bind(socket.fd(), reinterpret_cast<const sockaddr*>(&local), sizeof local) != 0) continue;
    const sockaddr_in all = control_endpoint({INADDR_BROADCAST});
    ::sendto(socket.fd(), kDiscoveryBroadcast.data(), kDiscoveryBroadcast.size(), 0,
             reinterpret_cast<const sockaddr*>(&all), sizeof all);
    out.push_back(std::move(socket));
  }
  ::freeifaddrs(interfaces);
  return out;
}

}  // namespace

// Layout: the first 0xf8 bytes of the bootstrap registers, GigE Vision 2.0, section 14.1.
std::optional<DiscoveredCamera> decode_discovery(const std::uint8_t* bytes, std::size_t size) {
  if (size < kHeader + kDiscoverySize || bytes[3] != 0x03) return std::nullopt;
  const std::uint8_t* data = bytes + kHeader;
  DiscoveredCamera out;
  std::array<char, 24> text{};
  std::snprintf(text.data(), text.size(), "%d.%d.%d.%d", data[0x24], data[0x25], data[0x26], data[0x27]);
  out.address = text.data();
  std::snprintf(text.data(), text.size(), "%02x:%02x:%02x:%02x:%02x:%02x", data[0x0a], data[0x0b], data[0x0c],
                data[0x0d], data[0x0e], data[0x0f]);
  out.mac = text.data();
  out.vendor = text_at(data + 0x48, 32);
  out.model = text_at(data + 0x68, 32);
  out.serial = text_at(data + 0xd8, 16);
  out.user_name = text_at(data + 0xe8, 16);
  return out;
}

std::optional<DiscoveredCamera> discover_at(const std::string& address, milliseconds timeout) {
  Reply reply{};
  const auto size = ask(address, kDiscovery, timeout, reply);
  return size ? decode_discovery(reply.data(), *size) : std::nullopt;
}

bool answers_discovery(const std::string& address, milliseconds timeout) {
  return discover_at(address, timeout).has_value();
}

std::vector<DiscoveredCamera> discover_all(milliseconds wait) {
  std::vector<DiscoveredCamera> out;
  const std::vector<UdpSocket> sockets = broadcast_everywhere();
  std::vector<pollfd> readable;
  for (const UdpSocket& socket : sockets) readable.push_back({socket.fd(), POLLIN, 0});
  const auto end = steady_clock::now() + wait;
  for (;;) {
    const auto left = std::chrono::duration_cast<milliseconds>(end - steady_clock::now());
    if (left.count() <= 0 || ::poll(readable.data(), readable.size(), static_cast<int>(left.count())) <= 0)
      break;
    for (const pollfd& socket : readable) {
      if (socket.revents == 0) continue;
      Reply reply{};
      const ssize_t size = ::recv(socket.fd, reply.data(), reply.size(), MSG_DONTWAIT);
      if (size <= 0 || !is_acknowledge(reply, size, 0x03)) continue;
      const auto camera = decode_discovery(reply.data(), static_cast<std::size_t>(size));
      const auto is_same = [&](const DiscoveredCamera& other) {
        return other.mac == camera->mac && other.address == camera->address;
      };
      if (camera && std::none_of(out.begin(), out.end(), is_same)) out.push_back(*camera);
    }
  }
  std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.serial < b.serial; });
  return out;
}

Result<> check_addresses_differ(const std::vector<DiscoveredCamera>& found) {
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const DiscoveredCamera &a = found[k], &b = found[i];
      if (a.address != b.address || a.mac == b.mac) continue;
      return unavailable(concat("two cameras use the address ", a.address),
                         concat("serial number ", a.serial, " at MAC ", a.mac, " and serial number ",
                                b.serial, " at MAC ", b.mac),
                         "give one of them another address");
    }
  }
  return {};
}

Result<std::vector<CameraAddress>> resolve_addresses(std::vector<CameraAddress> cameras) {
  const auto is_known = [](const CameraAddress& camera) { return !camera.address.empty(); };
  const auto is_own = [](const CameraAddress& camera) { return camera.address.starts_with("127."); };
  const bool are_known = std::all_of(cameras.begin(), cameras.end(), is_known);
  if (are_known && std::all_of(cameras.begin(), cameras.end(), is_own)) return cameras;
  const auto found = discover_all(are_known ? kTwinWait : kSearchWait);
  if (auto ok = check_addresses_differ(found); !ok) return tl::unexpected(ok.error());
  if (are_known) return cameras;
  std::string missing;
  for (CameraAddress& camera : cameras) {
    if (is_known(camera)) continue;
    const auto match = std::find_if(found.begin(), found.end(), [&](const DiscoveredCamera& other) {
      return camera.serial.empty() ? other.user_name == camera.name : other.serial == camera.serial;
    });
    if (match != found.end()) {
      camera.address = match->address;
    } else {
      missing += concat(missing.empty() ? "" : ", ", camera.name,
                        camera.serial.empty() ? "" : concat(" (serial ", camera.serial, ")"));
    }
  }
  if (missing.empty()) return cameras;
  return not_found(concat("cameras not found: ", missing),
                   "none of that serial number or user-defined name answered",
                   "check power and cables, or give their addresses");
}

std::optional<std::uint32_t> read_bootstrap_register(const std::string& address, std::uint32_t reg,
                                                     milliseconds timeout) {
  const auto byte = [](std::uint32_t value) { return static_cast<std::uint8_t>(value); };
  const std::array<std::uint8_t, 12> command = {
      0x42,           0x01,     0x00, 0x80, 0x00, 0x04, 0x00, 0x01, byte(reg >> 24), byte(reg >> 16),
      byte(reg >> 8), byte(reg)};
  Reply reply{};
  const auto size = ask(address, command, timeout, reply);
  if (!size || *size < kHeader + 4) return std::nullopt;
  return std::uint32_t{reply[8]} << 24 | std::uint32_t{reply[9]} << 16 | std::uint32_t{reply[10]} << 8 |
         reply[11];
}

}  // namespace flamefield
