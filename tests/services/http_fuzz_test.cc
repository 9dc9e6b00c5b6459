// What comes to the page's port is not always HTTP.
#include <gtest/gtest.h>

#include <random>

#include "services/gateway/exposure.h"
#include "services/gateway/gateway.h"
#include "tests/services/raw_socket.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;
using testing_support::port_of;
using testing_support::RawSocket;

std::uint16_t port_in(const std::string& url) {
  return port_of(url.substr(0, url.size() - 1));
}

bool answers(std::uint16_t port) {
  const RawSocket socket(port);
  socket.send("GET /api/v1/status HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  std::string got;
  for (std::string piece; !(piece = socket.receive(5000)).empty();) got += piece;
  return got.find("200 OK") != std::string::npos && got.find("{\"ok\":1}") != std::string::npos;
}

TEST(HttpFuzz, NoiseLiesAndFloodsHarmNobody) {
  Scratch scratch;
  GatewaySources sources;
  sources.api = [](std::string_view, const HttpRequest&) {
    return std::optional(HttpResponse{.body = "{\"ok\":1}", .file = {}, .headers = {}});
  };
  sources.volumes_folder = scratch.path();
  auto gateway = Gateway::open({.port = 0, .timeout_s = 1}, "", sources);
  ASSERT_TRUE(gateway) << gateway.error().message;
  std::jthread thread([&](std::stop_token stop) { (*gateway)->run(stop); });
  const std::uint16_t port = port_in((*gateway)->url());
  std::mt19937 random(20260301);
  const std::vector<std::string> seeds = {
      "GET / HTTP/1.1\r\nHost: x\r\n\r\n",
      "GET /volumes/../../etc/passwd HTTP/1.1\r\nHost: x\r\n\r\n",
      "GET /volumes/%2e%2e/%2e%2e/etc/passwd HTTP/1.1\r\nHost: x\r\n\r\n",
      "POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 1073741824\r\n\r\nabc",
      "POST / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nFFFFFFFFFFFFFFFF\r\nabc",
      "GET / HTTP/9.9\r\n" + std::string(9000, 'a') + ": b\r\n\r\n",
      "GET /" + std::string(20000, 'a') + " HTTP/1.1\r\n\r\n",
      "GET /api/v1/live HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: "
      "Upgrade\r\nSec-WebSocket-Key: "
      "!!\r\n\r\n\x81\xff",
  };
  for (int n = 0; n < 300; ++n) {
    std::string bytes = seeds[random() % seeds.size()];
    const std::size_t changes = random() % 8;
    for (std::size_t i = 0; i < changes; ++i) bytes[random() % bytes.size()] = static_cast<char>(random());
    if (random() % 3 == 0) bytes.resize(random() % bytes.size());
    const RawSocket socket(port);
    socket.send(bytes);
    EXPECT_EQ(socket.receive(n % 20 == 0 ? 200 : 0).find("root:"), std::string::npos)
        << "a file from outside";
    if (n % 50 == 0) {
      ASSERT_TRUE(testing_support::eventually([&] { return answers(port); })) << "after request " << n;
    }
  }
  EXPECT_TRUE(testing_support::eventually([&] { return answers(port); }));
}

TEST(HttpExposure, OnlyThisMachineMayReachThePage) {
  for (const char* near : {"127.0.0.1", "127.8.9.1", "::1"}) EXPECT_TRUE(check_exposure(near)) << near;
  for (const char* far : {"0.0.0.0", "192.168.7.1", "::", "fe80::1", "localhost", "127.1", ""})
    EXPECT_FALSE(check_exposure(far)) << far;
  const auto gateway = Gateway::open({.address = "0.0.0.0", .port = 0}, "", {});
  ASSERT_FALSE(gateway);
  EXPECT_EQ(gateway.error().code, ErrorCode::InvalidInput);
  EXPECT_NE(gateway.error().message.find("deploy/proxy"), std::string::npos);
}

}  // namespace
}  // namespace flamefield
