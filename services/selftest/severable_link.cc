#include "services/selftest/severable_link.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <deque>
#include <utility>
#include <vector>

namespace flamefield {

namespace {

sockaddr_in loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  return address;
}

// A socket that is reset, not closed, at its end: what is under way is lost, as on a cut wire.
class End {
 public:
  explicit End(int descriptor) : descriptor_(descriptor) {
    if (descriptor_ < 0) return;
    const int one = 1;
    ::setsockopt(descriptor_, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    ::fcntl(descriptor_, F_SETFL, O_NONBLOCK);
  }
  End(End&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  End& operator=(End&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  ~End() {
    if (descriptor_ < 0) return;
    const linger reset{1, 0};
    ::setsockopt(descriptor_, SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
    ::close(descriptor_);
  }
  int get() const { return descriptor_; }

 private:
  int descriptor_;
};

// One direction: what was read and not yet written.
struct Flow {
  std::array<char, 1 << 16> bytes;
  std::size_t from = 0, to = 0;

  bool is_empty() const { return from == to; }
  // False: the connection is over.
  bool pump(int in, int out) {
    if (is_empty()) {
      const ssize_t n = ::recv(in, bytes.data(), bytes.size(), 0);
      if (n == 0 || (n < 0 && errno != EAGAIN)) return false;
      from = 0;
      to = n > 0 ? static_cast<std::size_t>(n) : 0;
    }
    while (!is_empty()) {
      const ssize_t n = ::send(out, bytes.data() + from, to - from, MSG_NOSIGNAL);
      if (n < 0) return errno == EAGAIN;
      from += static_cast<std::size_t>(n);
    }
    return true;
  }
};

struct Connection {
  End near, far;
  std::unique_ptr<Flow> out = std::make_unique<Flow>(), back = std::make_unique<Flow>();
};

}  // namespace

SeverableLink::SeverableLink(int listener, int port, int to_port)
    : listener_(listener), port_(port), to_port_(to_port), thread_([this](std::stop_token s) { run(s); }) {}

Result<std::unique_ptr<SeverableLink>> SeverableLink::open(int to_port) {
  const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  sockaddr_in address = loopback(0);
  socklen_t length = sizeof address;
  if (listener < 0 || ::bind(listener, reinterpret_cast<sockaddr*>(&address), length) != 0 ||
      ::listen(listener, 16) != 0 ||
      ::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &length) != 0)
    return unavailable("a port on the loopback", std::strerror(errno), "close other programs");
  return std::unique_ptr<SeverableLink>(new SeverableLink(listener, ntohs(address.sin_port), to_port));
}

SeverableLink::~SeverableLink() {
  thread_.request_stop();
  thread_.join();
  ::close(listener_);
}

void SeverableLink::run(std::stop_token stop) {
  std::deque<Connection> connections;
  int cuts_seen = 0;
  while (!stop.stop_requested()) {
    if (const int cuts = cuts_; cuts != cuts_seen) {
      connections.clear();
      cuts_seen = cuts;
    }
    std::vector<pollfd> watched = {{listener_, POLLIN, 0}};
    for (const Connection& c : connections) {
      const auto wanted = [](const Flow& in, const Flow& out) {
        return static_cast<short>((in.is_empty() ? POLLIN : 0) | (out.is_empty() ? 0 : POLLOUT));
      };
      watched.push_back({c.near.get(), wanted(*c.out, *c.back), 0});
      watched.push_back({c.far.get(), wanted(*c.back, *c.out), 0});
    }
    if (::poll(watched.data(), watched.size(), 20) <= 0) continue;
    std::erase_if(connections, [](Connection& c) {
      return !c.out->pump(c.near.get(), c.far.get()) || !c.back->pump(c.far.get(), c.near.get());
    });
    if ((watched[0].revents & POLLIN) == 0) continue;
    End near(::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC));
    const int far = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_in address = loopback(to_port_);
    // Nobody there, as after a kill: the caller is reset, and tries again.
    const bool reached = ::connect(far, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    End other(far);
    if (near.get() >= 0 && reached) connections.push_back({std::move(near), std::move(other)});
  }
}

}  // namespace flamefield
