#include "acquire/discovery.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdint>

namespace flamefield {

namespace {

constexpr std::uint16_t kControlPort = 3956;
constexpr int kTries = 3;
// Key, acknowledge please, DISCOVERY, no payload, request id 1: GigE Vision 2.0, section 14.
constexpr std::array<std::uint8_t, 8> kCommand = {0x42, 0x01, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01};

bool is_acknowledge(const std::array<std::uint8_t, 576>& reply, ssize_t size) {
  return size >= 8 && reply[0] == 0 && reply[1] == 0 && reply[2] == 0x00 && reply[3] == 0x03 &&
         reply[6] == 0 && reply[7] == 1;
}

}  // namespace

bool answers_discovery(const std::string& address, std::chrono::milliseconds timeout) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(kControlPort);
  if (inet_pton(AF_INET, address.c_str(), &to.sin_addr) != 1) return false;
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return false;
  bool answered = false;
  // Connected, so that only the device's own answers come through, and "nobody there" comes at once.
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0) {
    for (int i = 0; i < kTries && !answered; ++i) {
      if (::send(fd, kCommand.data(), kCommand.size(), 0) < 0) break;
      pollfd readable{fd, POLLIN, 0};
      if (::poll(&readable, 1, static_cast<int>(timeout.count()) / kTries) <= 0) continue;
      std::array<std::uint8_t, 576> reply;
      answered = is_acknowledge(reply, ::recv(fd, reply.data(), reply.size(), 0));
    }
  }
  ::close(fd);
  return answered;
}

}  // namespace flamefield
