#include "services/bus/socket.h"

#include <sys/resource.h>

#include <cstring>
#include <mutex>

#include "proto/check.h"

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
extern "C" void AnnotateIgnoreReadsBegin(const char* file, int line);
extern "C" void AnnotateIgnoreReadsEnd(const char* file, int line);
#endif

namespace flamefield {

namespace {

// Between threads of one process ZeroMQ passes on the sender's own bytes, through queues that ThreadSanitizer
// does not see: it is told of the order here. Bytes from the wire were written by ZeroMQ's own thread: their
// copying is not looked at, for it would find, suppress and remember a race in each of a million words.
#if defined(__SANITIZE_THREAD__)
void hand_over(const void* bytes) {
  __tsan_release(const_cast<void*>(bytes));
}
void take_over(const void* bytes) {
  __tsan_acquire(const_cast<void*>(bytes));
}
struct Unobserved {
  Unobserved() { AnnotateIgnoreReadsBegin(__FILE__, __LINE__); }
  ~Unobserved() { AnnotateIgnoreReadsEnd(__FILE__, __LINE__); }
};
#else
void hand_over(const void*) {}
void take_over(const void*) {}
struct Unobserved {
  Unobserved() {}
};
#endif

constexpr std::size_t kMaxParts = kMaxCameras + 2;
constexpr char kDomain[] = "flamefield";
constexpr int kBacklog = 4096;        // connections that wait to be accepted: a whole cluster's at once
constexpr int kHandshake_ms = 5'000;  // then a connection that says nothing is closed

// Every connection is a file; the usual 1024 would turn away the workers of a cluster.
void allow_many_connections() {
  static std::once_flag once;
  std::call_once(once, [] {
    rlimit files{};
    if (::getrlimit(RLIMIT_NOFILE, &files) != 0) return;
    files.rlim_cur = files.rlim_max;
    ::setrlimit(RLIMIT_NOFILE, &files);
  });
}

bool is_inproc(const std::string& endpoint) {
  return endpoint.starts_with("inproc://");
}

// The frame's own bytes, kept alive by a reference that ZeroMQ drops when they are on the wire.
zmq::message_t zero_copy(const Bytes& bytes) {
  if (!bytes || bytes->empty()) return zmq::message_t();
  auto* reference = new Bytes(bytes);
  hand_over(bytes->data());
  return zmq::message_t(
      const_cast<std::byte*>(bytes->data()), bytes->size(),
      [](void*, void* hint) { delete static_cast<Bytes*>(hint); }, reference);
}

zmq::message_t message_of(const std::string& header) {
  zmq::message_t out(header);
  hand_over(out.data());
  return out;
}

Bytes copy_of(const zmq::message_t& part) {
  const auto* first = part.data<std::byte>();
  take_over(first);
  const Unobserved copying;
  return std::make_shared<const std::vector<std::byte>>(first, first + part.size());
}

}  // namespace

Socket::Socket(Bus& bus, zmq::socket_type type, const SocketOptions& options)
    : bus_(bus.impl()), is_router_(type == zmq::socket_type::router), socket_(bus_.context, type) {
  const int heartbeat_ms = static_cast<int>(options.heartbeat.count());
  socket_.set(zmq::sockopt::linger, 0);
  socket_.set(zmq::sockopt::sndhwm, options.queue_length);
  socket_.set(zmq::sockopt::rcvhwm, options.queue_length);
  socket_.set(zmq::sockopt::heartbeat_ivl, heartbeat_ms);
  socket_.set(zmq::sockopt::heartbeat_timeout, 3 * heartbeat_ms);
  socket_.set(zmq::sockopt::heartbeat_ttl, 3 * heartbeat_ms);
  socket_.set(zmq::sockopt::reconnect_ivl, 100);
  socket_.set(zmq::sockopt::reconnect_ivl_max, 1000);
  socket_.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(kMaxFrameBytes));
  if (is_router_) {
    socket_.set(zmq::sockopt::router_mandatory, true);  // a lost peer is an error, not a silent drop
    socket_.set(zmq::sockopt::router_handover, true);   // a peer that reconnects keeps its name
  }
}

// ZeroMQ's one I/O thread tells the monitor of a connection by a send that waits for a reader. Were the
// reader closed first, a connection that comes in that moment would stop every socket of the process for
// good.
Socket::~Socket() {
  if (handshakes_) zmq_socket_monitor(socket_.handle(), nullptr, 0);
}

void Socket::be_server() {
  if (!bus_.keys) return;
  allow_many_connections();
  socket_.set(zmq::sockopt::backlog, kBacklog);
  watch_handshakes();
  socket_.set(zmq::sockopt::handshake_ivl, kHandshake_ms);
  socket_.set(zmq::sockopt::curve_server, true);
  socket_.set(zmq::sockopt::curve_secretkey, bus_.keys->of("dispatcher").secret_key);
  socket_.set(zmq::sockopt::zap_domain, std::string(kDomain));
}

void Socket::be_client(const std::string& role) {
  if (!bus_.keys) return;
  const KeyPair& own = bus_.keys->of(role);
  socket_.set(zmq::sockopt::curve_publickey, own.public_key);
  socket_.set(zmq::sockopt::curve_secretkey, own.secret_key);
  socket_.set(zmq::sockopt::curve_serverkey, bus_.keys->dispatcher_public_key());
}

// Every connection that is accepted, and every handshake that succeeds, is told of on a socket of its own;
// what is missing of the second was turned away. Its queue has no limit, since a full one would block ZeroMQ.
void Socket::watch_handshakes() {
  static std::atomic<int> number = 0;
  const std::string place = concat("inproc://handshakes-", ++number);
  if (zmq_socket_monitor(socket_.handle(), place.c_str(),
                         ZMQ_EVENT_ACCEPTED | ZMQ_EVENT_HANDSHAKE_SUCCEEDED) != 0)
    return;
  handshakes_ = zmq::socket_t(bus_.context, zmq::socket_type::pair);
  handshakes_.set(zmq::sockopt::linger, 0);
  handshakes_.set(zmq::sockopt::rcvhwm, 0);
  handshakes_.connect(place);
}

// Part 0 of a monitor's message: 16 bits of event, 32 bits of value; part 1: the endpoint.
void Socket::count_handshakes() {
  if (!handshakes_) return;
  zmq::message_t part;
  while (handshakes_.recv(part, zmq::recv_flags::dontwait)) {
    std::uint16_t event = 0;
    if (part.size() == 6) std::memcpy(&event, part.data(), sizeof event);
    if (event == ZMQ_EVENT_ACCEPTED) ++bus_.accepted;
    if (event == ZMQ_EVENT_HANDSHAKE_SUCCEEDED) ++bus_.greeted;
  }
}

// A key counts for as long as it is on the list, not for as long as its connection lasts.
bool Socket::is_revoked(Delivery& delivery, zmq::message_t& part) {
  const char* key = bus_.allowed ? zmq_msg_gets(part.handle(), "User-Id") : nullptr;
  if (!key) {
    delivery.role = "local";
    return false;
  }
  const auto role = bus_.allowed->role_of(key);
  delivery.role = role.value_or("");
  return !role;
}

Result<> Socket::check_endpoint(const std::string& endpoint) const {
  if (is_inproc(endpoint) || bus_.keys) return {};
  return invalid_input(concat("endpoint ", endpoint), "only inproc:// works without keys",
                       "name a key directory with --keys");
}

Result<> Socket::bind(const std::string& endpoint) {
  if (auto ok = check_endpoint(endpoint); !ok) return ok;
  try {
    socket_.bind(endpoint);
    endpoint_ = socket_.get(zmq::sockopt::last_endpoint);
    return {};
  } catch (const zmq::error_t& error) {
    if (error.num() == EADDRINUSE)
      return unavailable(concat("endpoint ", endpoint), "another program is using it",
                         "stop that program or choose another endpoint");
    return invalid_input(concat("endpoint ", endpoint), error.what(),
                         "use e.g. tcp://127.0.0.1:27600 or inproc://dispatcher");
  }
}

Result<> Socket::connect(const std::string& endpoint) {
  if (auto ok = check_endpoint(endpoint); !ok) return ok;
  try {
    socket_.connect(endpoint);
    endpoint_ = endpoint;
    return {};
  } catch (const zmq::error_t& error) {
    return invalid_input(concat("endpoint ", endpoint), error.what(), "use e.g. tcp://127.0.0.1:27600");
  }
}

bool Socket::send(const std::string& peer, const Message& message, std::uint64_t request) {
  if (!is_router_) count_handshakes();
  const std::string header = encode(message, request);
  const FrameSet* set = frame_set_of(message);
  const std::size_t frames = set ? set->frames.size() : 0;
  const auto flags = [](bool more) {
    return more ? zmq::send_flags::dontwait | zmq::send_flags::sndmore : zmq::send_flags::dontwait;
  };
  try {
    // Only the first part can be refused: ZeroMQ takes a message as a whole.
    if (is_router_ && !socket_.send(zmq::buffer(peer), flags(true))) return false;
    if (!socket_.send(message_of(header), flags(frames > 0))) return false;
    for (std::size_t i = 0; i < frames; ++i) {
      if (!socket_.send(zero_copy(set->frames[i].bytes), flags(i + 1 < frames))) return false;
    }
    return true;
  } catch (const zmq::error_t&) {
    return false;  // EHOSTUNREACH: the peer is gone. ETERM: the bus closes.
  }
}

bool Socket::wait_readable(std::chrono::milliseconds timeout) {
  zmq::pollitem_t item{socket_.handle(), 0, ZMQ_POLLIN, 0};
  return zmq::poll(&item, 1, timeout) > 0;
}

std::optional<Delivery> Socket::receive(std::chrono::milliseconds timeout) {
  std::vector<zmq::message_t> parts;
  try {
    count_handshakes();
    if (!wait_readable(timeout)) return std::nullopt;
    bool more = true;
    while (more) {
      zmq::message_t part;
      if (!socket_.recv(part, zmq::recv_flags::dontwait)) return std::nullopt;
      more = part.more();
      if (parts.size() <= kMaxParts) parts.push_back(std::move(part));
    }
  } catch (const zmq::error_t&) {
    return std::nullopt;  // EINTR or ETERM
  }
  Delivery delivery;
  std::size_t next = 0;
  if (is_router_) delivery.peer = parts[next++].to_string();
  if (next == parts.size()) {
    delivery.message = invalid_input("message on the bus", "it has no header", "drop it");
    return delivery;
  }
  zmq::message_t& header = parts[next++];
  take_over(header.data());
  if (is_revoked(delivery, header)) {
    ++bus_.messages_revoked;
    delivery.message = invalid_input("message on the bus", "its key was taken off the allow-list", "drop it");
    return delivery;
  }
  auto envelope = decode(std::span(header.data<std::byte>(), header.size()));
  if (!envelope) {
    ++bus_.messages_malformed;
    delivery.message = tl::unexpected(envelope.error());
    return delivery;
  }
  delivery.request = envelope->request;
  delivery.message = std::move(envelope->message);
  FrameSet* set = frame_set_of(*delivery.message);
  if (parts.size() == next && !set) return delivery;
  std::vector<Bytes> pixels;
  for (; next < parts.size(); ++next) pixels.push_back(copy_of(parts[next]));
  FrameSet none;
  if (auto ok = attach_frames(set ? *set : none, std::move(pixels)); !ok)
    delivery.message = tl::unexpected(ok.error());
  return delivery;
}

}  // namespace flamefield
