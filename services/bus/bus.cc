#include "services/bus/bus.h"

#include <algorithm>

#include "proto/check.h"
#include "services/bus/socket.h"

namespace flamefield {

namespace {

constexpr int kMaxSockets = 65'000;

}  // namespace

Bus::Bus() : impl_(std::make_unique<Impl>()) {}

Bus::Bus(const KeyRing& keys) : impl_(std::make_unique<Impl>()) {
  impl_->context.set(zmq::ctxopt::max_sockets, kMaxSockets);
  impl_->keys = keys;
  impl_->allowed.emplace(keys);
  impl_->doorkeeper =
      std::thread([this, door = open_door(impl_->context)]() mutable { keep_door(std::move(door), *impl_); });
}

Bus::~Bus() {
  impl_->context.shutdown();
  if (impl_->doorkeeper.joinable()) impl_->doorkeeper.join();
}

std::map<std::string, std::int64_t> Bus::counters() const {
  const Impl& i = *impl_;
  return {{"bus_connections_refused", i.accepted - std::min(i.accepted.load(), i.greeted.load())},
          {"bus_keys_refused", i.keys_refused},
          {"bus_messages_revoked", i.messages_revoked},
          {"bus_messages_malformed", i.messages_malformed}};
}

namespace {

Result<> queued(bool sent, std::string_view to) {
  if (sent) return {};
  return unavailable(concat("message to ", to), "the peer is gone or its queue is full", "try again later");
}

}  // namespace

Router::Router(Bus& bus, const SocketOptions& options)
    : socket_(std::make_unique<Socket>(bus, zmq::socket_type::router, options)) {
  socket_->be_server();
}
Router::Router(Router&&) noexcept = default;
Router::~Router() = default;

Result<> Router::bind(const std::string& endpoint) {
  return socket_->bind(endpoint);
}

std::string Router::bound_endpoint() const {
  return socket_->endpoint();
}

Result<> Router::send(const std::string& peer, const Message& message, std::uint64_t request) {
  return queued(socket_->send(peer, message, request), peer);
}

std::optional<Delivery> Router::receive(std::chrono::milliseconds timeout) {
  return socket_->receive(timeout);
}

Dealer::Dealer(Bus& bus, std::string role, std::string name, const SocketOptions& options)
    : socket_(std::make_unique<Socket>(bus, zmq::socket_type::dealer, options)), name_(std::move(name)) {
  socket_->be_client(role);
  socket_->raw().set(zmq::sockopt::routing_id, name_);
}
Dealer::Dealer(Dealer&&) noexcept = default;
Dealer::~Dealer() = default;

Result<> Dealer::connect(const std::string& endpoint) {
  return socket_->connect(endpoint);
}

Result<> Dealer::send(const Message& message, std::uint64_t request) {
  return queued(socket_->send({}, message, request), socket_->endpoint());
}

std::optional<Delivery> Dealer::receive(std::chrono::milliseconds timeout) {
  return socket_->receive(timeout);
}

Publisher::Publisher(Bus& bus)
    : socket_(std::make_unique<Socket>(bus, zmq::socket_type::pub, SocketOptions{.queue_length = 1000})) {
  socket_->be_server();
}
Publisher::Publisher(Publisher&&) noexcept = default;
Publisher::~Publisher() = default;

Result<> Publisher::bind(const std::string& endpoint) {
  return socket_->bind(endpoint);
}

std::string Publisher::bound_endpoint() const {
  return socket_->endpoint();
}

void Publisher::publish(const Message& message) {
  expect(!frame_set_of(message), "published messages carry no pixels");
  socket_->send({}, message, 0);
}

Subscriber::Subscriber(Bus& bus, const std::string& role)
    : socket_(std::make_unique<Socket>(bus, zmq::socket_type::sub, SocketOptions{.queue_length = 1000})) {
  socket_->be_client(role);
  socket_->raw().set(zmq::sockopt::subscribe, "");
}
Subscriber::Subscriber(Subscriber&&) noexcept = default;
Subscriber::~Subscriber() = default;

Result<> Subscriber::connect(const std::string& endpoint) {
  return socket_->connect(endpoint);
}

std::optional<Delivery> Subscriber::receive(std::chrono::milliseconds timeout) {
  return socket_->receive(timeout);
}

}  // namespace flamefield
