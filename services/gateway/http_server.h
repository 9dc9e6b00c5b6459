#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>

#include "proto/error.h"
#include "services/gateway/notice_board.h"

namespace flamefield {

struct HttpRequest {
  std::string method;  // upper case
  std::string path;    // percent-decoded, without the query; begins with '/'
  std::string query;   // as sent, without '?'
  std::map<std::string, std::string, std::less<>> headers;  // names in lower case
  std::string body;

  std::string header(std::string_view name) const {
    const auto found = headers.find(name);
    return found == headers.end() ? std::string() : found->second;
  }
};

struct HttpResponse {
  int status = 200;
  std::string content_type = "application/json";
  std::string body;
  std::optional<std::filesystem::path> file;  // sent instead of the body, piece by piece
  std::map<std::string, std::string> headers;
};

// Called from several threads at once, which it may block. What it throws becomes a 500. Status 101 lets a
// WebSocket in.
using HttpHandler = std::function<HttpResponse(const HttpRequest&)>;

struct HttpServerOptions {
  std::string address = "127.0.0.1";  // a numeric address
  std::uint16_t port = 8080;          // 0: any free one
  std::string public_name = {};       // of a reverse proxy in front; empty: none
  int threads = 2;
  int max_connections = 256;  // further ones are closed at once
  std::uint32_t max_header_bytes = 8192;
  std::size_t max_body_bytes = 65536;
  double timeout_s = 20;         // for a request to arrive, and for a client that reads nothing
  NoticeBoard* board = nullptr;  // what WebSockets watch; outlives the server. Null: nothing to watch
};

// HTTP/1.1 and WebSockets on asynchronous sockets: a slow client costs a connection, never a thread.
//
// A WebSocket's client says in text messages what it wants, and when it has dealt with a binary message:
//   "want TOPIC TOPIC ..."   replaces what it wanted before; the newest of each is sent at once
//   "got"                    one more binary message may come; two may be on the way
// It gets the newest message of each topic, in turn, as fast as it deals with them.
class HttpServer {
 public:
  // Binds and listens. Unavailable: the port is taken (named) or the address is not ours.
  static Result<std::unique_ptr<HttpServer>> listen(HttpServerOptions options, HttpHandler handler);
  ~HttpServer();

  std::uint16_t port() const;

  // Serves until stopped; open connections are then dropped. Once only.
  void run(std::stop_token stop);

 private:
  struct Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// "%2e" and the like become bytes; none for a broken or zero escape.
std::optional<std::string> percent_decoded(const std::string& text);

}  // namespace flamefield
