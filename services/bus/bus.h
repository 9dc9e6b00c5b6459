#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "proto/codec.h"
#include "proto/message.h"
#include "services/bus/keys.h"

namespace flamefield {

// The process's part of the message bus. inproc:// endpoints join threads that share one Bus and need no
// keys; tcp:// and ipc:// endpoints are always encrypted and authenticated (CURVE, with a handler that lets
// only the key ring's public keys in). Outlives its sockets. Sockets stay in one thread each.
class Bus {
 public:
  Bus();                              // inproc only
  explicit Bus(const KeyRing& keys);  // all transports
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  // What was turned away so far: connections that did not get through the handshake (keys_refused: of these,
  // keys that are not on the list), and messages of keys that were revoked while they were connected.
  std::map<std::string, std::int64_t> counters() const;

  struct Impl;
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

// What arrived. A set's pixels are attached and checked; `message` is an error when the bytes were no
// message.
struct Delivery {
  std::string peer;  // routing id of the sender (Router only)
  std::string role;  // as authenticated, one of peer_roles(); "local" through inproc
  std::uint64_t request = 0;
  Result<Message> message;
};

struct SocketOptions {
  int queue_length = 64;  // messages waiting per peer and direction
  std::chrono::milliseconds heartbeat{1000};
};

class Socket;  // wraps the ZeroMQ socket, see socket.h

// Serves many peers, each addressed by its routing id.
class Router {
 public:
  explicit Router(Bus& bus, const SocketOptions& options = {});
  Router(Router&&) noexcept;
  ~Router();

  // May be called for several endpoints. Unavailable: in use. InvalidInput: malformed, or tcp without keys.
  Result<> bind(const std::string& endpoint);
  std::string bound_endpoint() const;  // the last one, with the port that "tcp://...:*" became

  // Unavailable: the peer is gone, or its queue is full.
  Result<> send(const std::string& peer, const Message& message, std::uint64_t request = 0);
  std::optional<Delivery> receive(std::chrono::milliseconds timeout);

 private:
  std::unique_ptr<Socket> socket_;
};

// One end of a conversation with a Router; reconnects by itself. `name` is its routing id, unique among
// peers.
class Dealer {
 public:
  Dealer(Bus& bus, std::string role, std::string name, const SocketOptions& options = {});
  Dealer(Dealer&&) noexcept;
  ~Dealer();

  Result<> connect(const std::string& endpoint);
  Result<> send(const Message& message, std::uint64_t request = 0);  // Unavailable: the queue is full
  std::optional<Delivery> receive(std::chrono::milliseconds timeout);
  const std::string& name() const { return name_; }

 private:
  std::unique_ptr<Socket> socket_;
  std::string name_;
};

// News that may be missed: single-part messages, dropped for whoever is too slow.
class Publisher {
 public:
  explicit Publisher(Bus& bus);
  Publisher(Publisher&&) noexcept;
  ~Publisher();
  Result<> bind(const std::string& endpoint);
  std::string bound_endpoint() const;
  void publish(const Message& message);  // contract: carries no pixels

 private:
  std::unique_ptr<Socket> socket_;
};

class Subscriber {
 public:
  explicit Subscriber(Bus& bus, const std::string& role = "operator");
  Subscriber(Subscriber&&) noexcept;
  ~Subscriber();
  Result<> connect(const std::string& endpoint);
  std::optional<Delivery> receive(std::chrono::milliseconds timeout);

 private:
  std::unique_ptr<Socket> socket_;
};

}  // namespace flamefield
