#include "services/api/pages.h"

#include <array>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "proto/utc.h"
#include "services/api/call.h"
#include "services/api/prometheus.h"

namespace flamefield {
namespace {

std::string metrics_text(LiveServices& services) {
  const auto array = services.ask_array<CaptureState>(GetCapture{});
  const auto status = services.ask_dispatcher<Status>(GetStatus{});
  const auto ledger = ledger_figures(services.data_dir(), utc_now_ns());
  return prometheus_text(array ? std::optional(*array) : std::nullopt,
                         status ? std::optional(*status) : std::nullopt) +
         prometheus_text(ledger ? std::optional(*ledger) : std::nullopt,
                         machine_figures(services.data_dir()));
}

}  // namespace

std::optional<HttpResponse> answer_api(LiveServices& services, std::string_view path,
                                       const HttpRequest& request) {
  Call call{services, request, {}};
  std::istringstream text{std::string(path)};
  for (std::string part; std::getline(text, part, '/');) {
    if (part.empty()) return std::nullopt;
    call.parts.push_back(part);
  }
  if (call.parts.empty()) return std::nullopt;
  constexpr std::array kRoutes = {answer_runs, answer_captures, answer_recipes,    answer_array,
                                  answer_work, answer_records,  answer_calibration};
  try {
    for (const auto route : kRoutes) {
      if (auto response = route(call)) return response;
    }
  } catch (const nlohmann::json::type_error& problem) {  // a field of another type, e.g. "pulses": "many"
    return error_answer(
        invalid_input("the request's body", problem.what(), "see /api/v1/openapi.json").value());
  }
  return std::nullopt;
}

Result<std::unique_ptr<Pages>> Pages::open(Bus& bus, HttpServerOptions http,
                                           const ServiceAddresses& addresses,
                                           const std::filesystem::path& report) {
  const auto token = token_in(addresses.data_dir / "run" / "web-token");
  if (!token) return tl::unexpected(token.error());
  std::unique_ptr<Pages> pages(new Pages);
  pages->services_ = std::make_shared<LiveServices>(bus, addresses);
  pages->feed_ = std::make_unique<LiveFeed>(pages->services_, pages->board_,
                                            report.empty() ? "" : "/report/" + report.filename().string());
  GatewaySources sources;
  sources.api = [p = pages.get()](std::string_view path,
                                  const HttpRequest& request) -> std::optional<HttpResponse> {
    if (path != "status") return answer_api(*p->services_, path, request);
    constexpr std::chrono::seconds kPatience{3};  // a look at the services takes less
    const auto status = p->board_.wait_for("status", kPatience);
    if (!status) return json_error(503, "the first look at the services is not over (try again)");
    return HttpResponse{
        .status = 200, .content_type = "application/json", .body = *status->bytes, .file = {}, .headers = {}};
  };
  sources.metrics_text = [services = pages->services_] { return metrics_text(*services); };
  sources.volumes_folder = addresses.data_dir / "volumes";
  sources.calibrations_folder = addresses.data_dir / "calibrations";
  if (!report.empty()) sources.report_folder = report.parent_path();
  http.board = &pages->board_;
  auto gateway = Gateway::open(std::move(http), *token, std::move(sources));
  if (!gateway) return tl::unexpected(gateway.error());
  pages->gateway_ = std::move(*gateway);
  return pages;
}

void Pages::run(std::stop_token stop) {
  const std::jthread feed([this](std::stop_token ended) { feed_->run(std::move(ended)); });
  gateway_->run(std::move(stop));
}

}  // namespace flamefield
