#pragma once

#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>

#include "services/api/live_feed.h"
#include "services/api/live_services.h"
#include "services/gateway/gateway.h"

namespace flamefield {

// The gateway with everything it shows: pages, API, live messages. It may sit in the services' process or in
// one of its own.
class Pages {
 public:
  // Unavailable: the port is in use, or the token for commands (DATA/run/web-token) cannot be written.
  static Result<std::unique_ptr<Pages>> open(Bus& bus, HttpServerOptions http,
                                             const ServiceAddresses& addresses,
                                             const std::filesystem::path& report);

  std::string url() const { return gateway_->url(); }
  void run(std::stop_token stop);

 private:
  Pages() = default;
  NoticeBoard board_;
  std::shared_ptr<LiveServices> services_;
  std::unique_ptr<LiveFeed> feed_;
  std::unique_ptr<Gateway> gateway_;
};

// The answer to a request below /api/v1/, without a socket.
std::optional<HttpResponse> answer_api(LiveServices& services, std::string_view path,
                                       const HttpRequest& request);

}  // namespace flamefield
