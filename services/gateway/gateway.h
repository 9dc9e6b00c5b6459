#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>

#include "proto/error.h"
#include "services/gateway/http_server.h"

namespace flamefield {

// Where the pages' contents come from. Called from several threads at once; each may be left empty (404).
// none: there is no such thing. The JSON that the live page reads is described in the README of this folder.
struct GatewaySources {
  std::function<std::string()> status_json;
  std::function<std::string()> runs_json;
  std::function<std::string()> metrics_text;  // for Prometheus
  std::function<std::optional<std::string>(std::string_view run)> run_json;
  std::function<std::optional<std::string>(std::string_view capture)> receipt_json;
  std::function<std::optional<std::string>(std::string_view camera)> preview_png;
  std::function<std::optional<std::string>()> newest_volume_png;
  std::filesystem::path volumes_folder;  // served below /volumes/
  std::filesystem::path report_folder;   // served below /report/
};

// The answer to one request, without a socket.
//   /  /metrics  /api/v1/status  /api/v1/runs  /api/v1/runs/ID  /api/v1/captures/ID/receipt
//   /api/v1/preview/CAMERA.png  /api/v1/volume.png  /volumes/FILE  /report/FILE
HttpResponse answer(const HttpRequest& request, const GatewaySources& sources);

// The live page and its API.
class Gateway {
 public:
  // Unavailable: the port is in use (named).
  static Result<std::unique_ptr<Gateway>> open(HttpServerOptions options, GatewaySources sources);

  std::string url() const;  // "http://127.0.0.1:8080/"
  void run(std::stop_token stop) { server_->run(std::move(stop)); }

 private:
  Gateway(std::string address, GatewaySources sources)
      : address_(std::move(address)), sources_(std::move(sources)) {}
  std::string address_;
  GatewaySources sources_;
  std::unique_ptr<HttpServer> server_;
};

// services/gateway/web/index.html, put into the program by the build.
extern const std::string_view kLivePage;

}  // namespace flamefield
