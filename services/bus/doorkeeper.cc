#include <zmq_addon.hpp>

#include "services/bus/socket.h"

namespace flamefield {

namespace {

// The client's key in a ZAP request (ZeroMQ RFC 27): 7 frames, mechanism CURVE, 32 bytes of credentials.
std::string public_key_of(const std::vector<zmq::message_t>& request) {
  if (request.size() != 7 || request[5].to_string_view() != "CURVE" || request[6].size() != 32) return {};
  char text[41] = {};
  zmq_z85_encode(text, request[6].data<std::uint8_t>(), 32);
  return text;
}

void answer(zmq::socket_t& socket, const std::vector<zmq::message_t>& request, Bus::Impl& bus) {
  const std::string key = public_key_of(request);
  const auto role = bus.allowed->role_of(key);
  const bool known = role.has_value();
  if (!known) ++bus.keys_refused;
  const std::string sequence = request.size() > 1 ? request[1].to_string() : std::string();
  zmq::multipart_t reply;
  reply.addstr("1.0");
  reply.addstr(sequence);
  // A refusal is 300, "temporary": libzmq's client then goes on trying, and gets in when its key is allowed.
  reply.addstr(known ? "200" : "300");
  reply.addstr(known ? "OK" : "public key is not on the allow-list");
  reply.addstr(known ? key : "");  // becomes "User-Id" of every message of this connection
  reply.addstr("");
  reply.send(socket);
}

}  // namespace

zmq::socket_t open_door(zmq::context_t& context) {
  zmq::socket_t socket(context, zmq::socket_type::rep);
  socket.set(zmq::sockopt::linger, 0);
  socket.bind("inproc://zeromq.zap.01");
  return socket;
}

void keep_door(zmq::socket_t socket, Bus::Impl& bus) {
  while (true) {
    try {
      std::vector<zmq::message_t> request;
      if (zmq::recv_multipart(socket, std::back_inserter(request))) answer(socket, request, bus);
    } catch (const zmq::error_t& error) {
      if (error.num() == ETERM) return;  // the bus closes; nothing else ends the watch
    }
  }
}

}  // namespace flamefield
