#include "services/gateway/gateway.h"

#include <algorithm>
#include <array>
#include <system_error>
#include <utility>

namespace flamefield {
namespace {

// Our pages need nothing from elsewhere, so nothing from elsewhere is let in.
constexpr const char* kPolicy =
    "default-src 'none'; img-src 'self' data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
    "connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

HttpResponse ok(std::string content_type, std::string body) {
  return {.status = 200,
          .content_type = std::move(content_type),
          .body = std::move(body),
          .file = {},
          .headers = {}};
}

// `message` holds no quotes or user input.
HttpResponse error(int status, const std::string& message) {
  return {.status = status,
          .content_type = "application/json",
          .body = "{\"error\":\"" + message + "\"}\n",
          .file = {},
          .headers = {}};
}

HttpResponse answer_or_none(std::optional<std::string> body, const char* content_type) {
  return body ? ok(content_type, std::move(*body)) : error(404, "there is no such thing");
}

// What is between prefix and suffix, unless that is empty or has a slash.
std::optional<std::string> between(const std::string& path, std::string_view prefix,
                                   std::string_view suffix = "") {
  if (path.size() <= prefix.size() + suffix.size() || !path.starts_with(prefix) || !path.ends_with(suffix)) {
    return std::nullopt;
  }
  std::string name = path.substr(prefix.size(), path.size() - prefix.size() - suffix.size());
  return name.find('/') == std::string::npos ? std::optional(std::move(name)) : std::nullopt;
}

std::string type_of(const std::filesystem::path& file) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 6> kTypes = {{
      {".html", "text/html; charset=utf-8"},
      {".json", "application/json"},
      {".png", "image/png"},
      {".svg", "image/svg+xml"},
      {".yaml", "text/plain; charset=utf-8"},
      {".toml", "text/plain; charset=utf-8"},
  }};
  const auto found = std::ranges::find(kTypes, file.extension().string(),
                                       &std::pair<std::string_view, std::string_view>::first);
  return std::string(found == kTypes.end() ? "application/octet-stream" : found->second);
}

// A regular file inside the folder; symbolic links are followed first, so none leads out.
HttpResponse file_in(const std::filesystem::path& folder, const std::string& name) {
  if (folder.empty()) return error(404, "nothing is served here");
  const std::filesystem::path relative(name);
  const bool climbs = std::ranges::any_of(relative, [](const auto& part) { return part == ".."; });
  if (climbs || relative.is_absolute() || name.find('\\') != std::string::npos) {
    return error(400, "paths must not leave the folder");
  }
  std::error_code failed;
  const auto root = std::filesystem::canonical(folder, failed);
  if (failed) return error(404, "there is no such file");
  const auto file = std::filesystem::canonical(root / relative, failed);
  if (failed || !std::filesystem::is_regular_file(file, failed)) return error(404, "there is no such file");
  const bool inside = std::mismatch(root.begin(), root.end(), file.begin(), file.end()).first == root.end();
  if (!inside) return error(404, "there is no such file");
  return {.status = 200, .content_type = type_of(file), .body = "", .file = file, .headers = {}};
}

HttpResponse routed(const std::string& path, const GatewaySources& s) {
  const char* const json = "application/json";
  if (path == "/") return ok("text/html; charset=utf-8", std::string(kLivePage));
  if (path == "/api/v1/status" && s.status_json) return ok(json, s.status_json());
  if (path == "/metrics" && s.metrics_text) return ok("text/plain; version=0.0.4", s.metrics_text());
  if (path == "/api/v1/runs" && s.runs_json) return ok(json, s.runs_json());
  if (path == "/api/v1/volume.png" && s.newest_volume_png)
    return answer_or_none(s.newest_volume_png(), "image/png");
  if (const auto camera = between(path, "/api/v1/preview/", ".png"); camera && s.preview_png) {
    return answer_or_none(s.preview_png(*camera), "image/png");
  }
  if (const auto run = between(path, "/api/v1/runs/"); run && s.run_json) {
    return answer_or_none(s.run_json(*run), json);
  }
  if (const auto capture = between(path, "/api/v1/captures/", "/receipt"); capture && s.receipt_json) {
    return answer_or_none(s.receipt_json(*capture), json);
  }
  if (path.starts_with("/volumes/")) return file_in(s.volumes_folder, path.substr(9));
  if (path.starts_with("/report/")) return file_in(s.report_folder, path.substr(8));
  return error(404, "there is no such page");
}

}  // namespace

HttpResponse answer(const HttpRequest& request, const GatewaySources& sources) {
  HttpResponse response =
      request.method == "GET" ? routed(request.path, sources) : error(405, "only GET is allowed");
  if (response.status == 405) response.headers["Allow"] = "GET";
  response.headers["Cache-Control"] = "no-store";
  response.headers["X-Content-Type-Options"] = "nosniff";
  response.headers["Content-Security-Policy"] = kPolicy;
  return response;
}

Result<std::unique_ptr<Gateway>> Gateway::open(HttpServerOptions options, GatewaySources sources) {
  std::unique_ptr<Gateway> gateway(new Gateway(options.address, std::move(sources)));
  auto server = HttpServer::listen(std::move(options), [g = gateway.get()](const HttpRequest& request) {
    return answer(request, g->sources_);
  });
  if (!server) return tl::unexpected(server.error());
  gateway->server_ = std::move(*server);
  return gateway;
}

std::string Gateway::url() const {
  return concat("http://", address_, ":", server_->port(), "/");
}

}  // namespace flamefield
