#include "services/gateway/gateway.h"

#include <algorithm>
#include <array>
#include <system_error>
#include <utility>

#include "services/gateway/exposure.h"
#include "services/gateway/web_files.h"

namespace flamefield {
namespace {

// Our pages need nothing from elsewhere, so nothing from elsewhere is let in.
constexpr const char* kPolicy =
    "default-src 'none'; img-src 'self' data: blob:; style-src 'self'; script-src 'self'; connect-src "
    "'self'; "
    "worker-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";
// Reports are whole in one file, with their style in it, and run nothing.
constexpr const char* kReportPolicy =
    "default-src 'none'; img-src 'self' data:; style-src 'unsafe-inline'; frame-ancestors 'none'; base-uri "
    "'none'; form-action 'none'";
constexpr std::string_view kApi = "/api/v1/";

HttpResponse ok(std::string content_type, std::string body) {
  return {.status = 200,
          .content_type = std::move(content_type),
          .body = std::move(body),
          .file = {},
          .headers = {}};
}

std::string type_of(const std::filesystem::path& file) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 8> kTypes = {{
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
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
  if (folder.empty()) return json_error(404, "nothing is served here");
  const std::filesystem::path relative(name);
  const bool climbs = std::ranges::any_of(relative, [](const auto& part) { return part == ".."; });
  if (climbs || relative.is_absolute() || name.find('\\') != std::string::npos) {
    return json_error(400, "paths must not leave the folder");
  }
  std::error_code failed;
  const auto root = std::filesystem::canonical(folder, failed);
  if (failed) return json_error(404, "there is no such file");
  const auto file = std::filesystem::canonical(root / relative, failed);
  if (failed || !std::filesystem::is_regular_file(file, failed))
    return json_error(404, "there is no such file");
  const bool inside = std::mismatch(root.begin(), root.end(), file.begin(), file.end()).first == root.end();
  if (!inside) return json_error(404, "there is no such file");
  return {.status = 200, .content_type = type_of(file), .body = "", .file = file, .headers = {}};
}

// A file of the front end. All but the page itself have their contents' hash in the name.
std::optional<HttpResponse> web_file(const std::string& path) {
  const std::string name = path == "/" ? "/index.html" : path;
  const auto found = std::ranges::find(web_files(), name, &WebFile::path);
  if (found == web_files().end()) return std::nullopt;
  HttpResponse response = ok(type_of(name), std::string(found->bytes));
  if (found->is_gzip) response.headers["Content-Encoding"] = "gzip";
  if (path.starts_with("/assets/")) response.headers["Cache-Control"] = "public, max-age=31536000, immutable";
  return response;
}

bool is_command(const HttpRequest& request) {
  return request.method == "POST" || request.method == "PUT" || request.method == "DELETE";
}

HttpResponse api_answer(const HttpRequest& request, const Guard& guard, const GatewaySources& sources) {
  const std::string path = request.path.substr(kApi.size());
  if (is_command(request)) {
    if (auto refusal = guard.refuse_command(request)) return std::move(*refusal);
  }
  if (path == "openapi.json") return ok("application/json", std::string(openapi_json()));
  if (path == "live") return {.status = 101, .content_type = "", .body = "", .file = {}, .headers = {}};
  if (sources.api) {
    if (auto response = sources.api(path, request)) return std::move(*response);
  }
  return json_error(404, "there is no such thing");
}

HttpResponse routed(const HttpRequest& request, const Guard& guard, const GatewaySources& sources) {
  if (auto refusal = guard.refuse(request)) return std::move(*refusal);
  const std::string& path = request.path;
  if (path.starts_with(kApi) && (request.method == "GET" || is_command(request)))
    return api_answer(request, guard, sources);
  if (request.method != "GET") {
    HttpResponse response = json_error(405, "only GET is allowed here");
    response.headers["Allow"] = "GET";
    return response;
  }
  if (path == "/metrics" && sources.metrics_text)
    return ok("text/plain; version=0.0.4", sources.metrics_text());
  if (path.starts_with("/volumes/")) return file_in(sources.volumes_folder, path.substr(9));
  if (path.starts_with("/calibrations/")) return file_in(sources.calibrations_folder, path.substr(14));
  if (path.starts_with("/report/")) return file_in(sources.report_folder, path.substr(8));
  if (auto file = web_file(path)) {
    if (path == "/") {
      if (const auto cookie = guard.cookie_for(request)) file->headers["Set-Cookie"] = *cookie;
    }
    return std::move(*file);
  }
  return json_error(404, "there is no such page");
}

}  // namespace

HttpResponse json_error(int status, std::string_view message) {
  std::string body = "{\"error\":\"";
  for (const char c : message) {
    if (c == '"' || c == '\\') body += '\\';
    body += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return {.status = status,
          .content_type = "application/json",
          .body = body + "\"}\n",
          .file = {},
          .headers = {}};
}

HttpResponse answer(const HttpRequest& request, const Guard& guard, const GatewaySources& sources) {
  HttpResponse response = routed(request, guard, sources);
  response.headers.try_emplace("Cache-Control", "no-store");
  response.headers["X-Content-Type-Options"] = "nosniff";
  response.headers["Referrer-Policy"] = "no-referrer";
  const bool is_report = request.path.starts_with("/report/") || request.path.starts_with("/calibrations/");
  response.headers["Content-Security-Policy"] = is_report ? kReportPolicy : kPolicy;
  return response;
}

Result<std::unique_ptr<Gateway>> Gateway::open(HttpServerOptions options, const std::string& token,
                                               GatewaySources sources) {
  if (auto ok = check_exposure(options.address); !ok) return tl::unexpected(ok.error());
  Guard guard(token, options.public_name);
  std::unique_ptr<Gateway> gateway(new Gateway(options.address, std::move(guard), std::move(sources)));
  auto server = HttpServer::listen(std::move(options), [g = gateway.get()](const HttpRequest& request) {
    return answer(request, g->guard_, g->sources_);
  });
  if (!server) return tl::unexpected(server.error());
  gateway->server_ = std::move(*server);
  return gateway;
}

std::string Gateway::url() const {
  return concat("http://", address_, ":", server_->port(), "/");
}

}  // namespace flamefield
