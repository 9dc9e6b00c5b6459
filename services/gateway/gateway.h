#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>

#include "proto/error.h"
#include "services/gateway/guard.h"
#include "services/gateway/http_server.h"
#include "services/gateway/notice_board.h"

namespace flamefield {

// Where the pages' contents come from. Called from several threads at once; each may be left empty (404).
struct GatewaySources {
  // What lies below /api/v1/; `path` is the rest, without a slash at its start. none: there is no such thing.
  // Commands (POST, PUT, DELETE) have passed the guard when they come here.
  std::function<std::optional<HttpResponse>(std::string_view path, const HttpRequest&)> api;
  std::function<std::string()> metrics_text;  // for Prometheus
  std::filesystem::path volumes_folder;       // served below /volumes/
  std::filesystem::path calibrations_folder;  // reports of sessions, served below /calibrations/
  std::filesystem::path report_folder;        // served below /report/
};

// The answer to one request, without a socket.
//   /  /assets/FILE  /metrics  /api/v1/openapi.json  /api/v1/live (WebSocket)  /api/v1/...
//   /volumes/FILE  /calibrations/FILE  /report/FILE
HttpResponse answer(const HttpRequest& request, const Guard& guard, const GatewaySources& sources);

// The pages and their API.
class Gateway {
 public:
  // Unavailable: the port is in use (named). `token` lets commands in; empty: nobody may command.
  static Result<std::unique_ptr<Gateway>> open(HttpServerOptions options, const std::string& token,
                                               GatewaySources sources);

  std::string url() const;  // "http://127.0.0.1:8080/"
  void run(std::stop_token stop) { server_->run(std::move(stop)); }

 private:
  Gateway(std::string address, Guard guard, GatewaySources sources)
      : address_(std::move(address)), guard_(std::move(guard)), sources_(std::move(sources)) {}
  std::string address_;
  Guard guard_;
  GatewaySources sources_;
  std::unique_ptr<HttpServer> server_;
};

// A JSON error; `message` may hold anything.
HttpResponse json_error(int status, std::string_view message);

}  // namespace flamefield
