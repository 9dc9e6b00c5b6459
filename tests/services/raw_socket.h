#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <string>
#include <thread>

// TCP without any protocol: what goes over the wire is spelt out in the tests.
namespace flamefield::testing_support {

// The port of "tcp://127.0.0.1:12345".
inline std::uint16_t port_of(const std::string& endpoint) {
  return static_cast<std::uint16_t>(std::stoi(endpoint.substr(endpoint.rfind(':') + 1)));
}

inline sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

class RawSocket {
 public:
  explicit RawSocket(std::uint16_t port) : fd_(::socket(AF_INET, SOCK_STREAM, 0)) {
    const sockaddr_in address = loopback(port);
    is_connected_ = ::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  explicit RawSocket(int fd) : fd_(fd), is_connected_(fd >= 0) {}
  ~RawSocket() { ::close(fd_); }
  RawSocket(const RawSocket&) = delete;
  RawSocket& operator=(const RawSocket&) = delete;

  bool is_connected() const { return is_connected_; }
  int fd() const { return fd_; }
  bool send(const std::string& bytes) const {
    std::size_t sent = 0;
    while (sent < bytes.size()) {
      const ssize_t n = ::send(fd_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (n <= 0) return false;
      sent += static_cast<std::size_t>(n);
    }
    return true;
  }
  // What has arrived, after waiting for `wait_ms` at most; empty: nothing, or the end.
  std::string receive(int wait_ms) const {
    pollfd item{fd_, POLLIN, 0};
    if (::poll(&item, 1, wait_ms) <= 0) return {};
    char buffer[65536];
    const ssize_t n = ::recv(fd_, buffer, sizeof buffer, 0);
    return n > 0 ? std::string(buffer, static_cast<std::size_t>(n)) : std::string();
  }
  // Does the other side close within the time?
  bool is_closed_within(std::chrono::milliseconds limit) const {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (std::chrono::steady_clock::now() < end) {
      pollfd item{fd_, POLLIN, 0};
      if (::poll(&item, 1, 50) <= 0) continue;
      char buffer[4096];
      if (::recv(fd_, buffer, sizeof buffer, 0) <= 0) return true;
    }
    return false;
  }

 private:
  int fd_ = -1;
  bool is_connected_ = false;
};

// Stands between a client and a server, writes down what the client says, and may say something itself.
class Wiretap {
 public:
  explicit Wiretap(std::uint16_t server_port)
      : listener_(::socket(AF_INET, SOCK_STREAM, 0)), server_(server_port) {
    sockaddr_in address = loopback(0);
    ::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address);
    socklen_t size = sizeof address;
    ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
    ::listen(listener_, 1);
    thread_ = std::jthread([this](std::stop_token stop) { run(stop); });
  }
  ~Wiretap() {
    thread_.request_stop();
    thread_.join();
    ::close(listener_);
  }
  std::uint16_t port() const { return port_; }
  std::string heard() const {
    const std::scoped_lock lock(mutex_);
    return heard_;
  }
  // Goes to the server in the middle of the client's stream.
  void inject(const std::string& bytes) { server_.send(bytes); }
  bool server_closed() const { return server_closed_; }

 private:
  void run(std::stop_token stop) {
    pollfd waiting{listener_, POLLIN, 0};
    while (::poll(&waiting, 1, 50) <= 0) {
      if (stop.stop_requested()) return;
    }
    const RawSocket client(::accept(listener_, nullptr, nullptr));
    while (!stop.stop_requested()) {
      pollfd ends[2] = {{client.fd(), POLLIN, 0}, {server_.fd(), POLLIN, 0}};
      if (::poll(ends, 2, 50) <= 0) continue;
      if ((ends[0].revents & (POLLIN | POLLHUP)) != 0) {
        const std::string bytes = client.receive(0);
        if (bytes.empty()) return;
        {
          const std::scoped_lock lock(mutex_);
          heard_ += bytes;
        }
        server_.send(bytes);
      }
      if ((ends[1].revents & (POLLIN | POLLHUP)) != 0) {
        const std::string bytes = server_.receive(0);
        if (bytes.empty()) {
          server_closed_ = true;
          return;
        }
        client.send(bytes);
      }
    }
  }

  int listener_;
  RawSocket server_;
  std::uint16_t port_ = 0;
  mutable std::mutex mutex_;
  std::string heard_;
  std::atomic<bool> server_closed_ = false;
  std::jthread thread_;
};

}  // namespace flamefield::testing_support
