#pragma once

#include <atomic>
#include <optional>
#include <string>
#include <thread>
#include <vector>
#include <zmq.hpp>

#include "services/bus/allowed_keys.h"
#include "services/bus/bus.h"

// Known to this folder only: everything that touches ZeroMQ.
namespace flamefield {

struct Bus::Impl {
  zmq::context_t context;
  std::optional<KeyRing> keys;
  std::optional<AllowedKeys> allowed;
  std::atomic<std::int64_t> accepted = 0, greeted = 0;  // connections; and those of them that got through
  std::atomic<std::int64_t> keys_refused = 0, messages_revoked = 0, messages_malformed = 0;
  std::thread doorkeeper;  // answers ZeroMQ's question who may connect (ZAP)
};

// A ZeroMQ socket with the options that all of ours share. Exceptions end here.
class Socket {
 public:
  Socket(Bus& bus, zmq::socket_type type, const SocketOptions& options);
  ~Socket();
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;

  void be_server();                         // dispatcher's side of CURVE
  void be_client(const std::string& role);  // the others' side
  Result<> bind(const std::string& endpoint);
  Result<> connect(const std::string& endpoint);
  const std::string& endpoint() const { return endpoint_; }

  // `peer` is empty except for a Router. False when the message could not be queued.
  bool send(const std::string& peer, const Message& message, std::uint64_t request);
  std::optional<Delivery> receive(std::chrono::milliseconds timeout);
  zmq::socket_t& raw() { return socket_; }

 private:
  Result<> check_endpoint(const std::string& endpoint) const;
  bool wait_readable(std::chrono::milliseconds timeout);
  void watch_handshakes();
  void count_handshakes();
  bool is_revoked(Delivery& delivery, zmq::message_t& part);

  Bus::Impl& bus_;
  bool is_router_;
  zmq::socket_t socket_;
  zmq::socket_t handshakes_;  // a server's monitor
  std::string endpoint_;
};

// ZeroMQ asks at this socket who may connect. Without it CURVE would let in anybody, so it is bound before
// any socket of ours exists.
zmq::socket_t open_door(zmq::context_t& context);

// Answers until the context is shut down.
void keep_door(zmq::socket_t socket, Bus::Impl& bus);

}  // namespace flamefield
