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

#include "proto/error.h"

namespace flamefield {

struct HttpRequest {
  std::string method;  // upper case
  std::string path;    // percent-decoded, without the query; begins with '/'
  std::string query;   // as sent, without '?'
};

struct HttpResponse {
  int status = 200;
  std::string content_type = "application/json";
  std::string body;
  std::optional<std::filesystem::path> file;  // sent instead of the body, piece by piece
  std::map<std::string, std::string> headers;
};

// Called from several threads at once. What it throws becomes a 500.
using HttpHandler = std::function<HttpResponse(const HttpRequest&)>;

struct HttpServerOptions {
  std::string address = "127.0.0.1";  // a numeric address; 0.0.0.0: everybody may connect
  std::uint16_t port = 8080;          // 0: any free one
  int threads = 2;
  int max_connections = 64;  // further ones are closed at once
  std::uint32_t max_header_bytes = 8192;
  std::size_t max_body_bytes = 4096;
  double timeout_s = 20;  // for a request to arrive, and for a client that reads nothing
};

// HTTP/1.1 on asynchronous sockets: a slow client costs a connection, never a thread.
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
