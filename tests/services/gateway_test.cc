#include "services/gateway/gateway.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "services/report/gnuplot.h"

namespace flamefield {
namespace {

// A client that knows nothing of HTTP: what goes over the wire is spelt out in the tests.
class Client {
 public:
  explicit Client(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
    const timeval limit{5, 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    connected_ = connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  ~Client() { ::close(socket_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  bool connected() const { return connected_; }
  void send(const std::string& bytes) {
    std::size_t sent = 0;
    while (sent < bytes.size()) {
      const ssize_t n = ::send(socket_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (n <= 0) return;
      sent += static_cast<std::size_t>(n);
    }
  }
  // Until the server closes or five seconds pass.
  std::string receive_all() {
    std::string out;
    char buffer[65536];
    for (ssize_t n; (n = recv(socket_, buffer, sizeof buffer, 0)) > 0;)
      out.append(buffer, static_cast<std::size_t>(n));
    return out;
  }
  std::string receive_until(const std::string& end) {
    std::string out;
    char c = 0;
    while (!out.ends_with(end) && recv(socket_, &c, 1, 0) == 1) out += c;
    return out;
  }

 private:
  int socket_;
  bool connected_ = false;
};

bool contains(const std::string& text, std::string_view part) {
  return text.find(part) != std::string::npos;
}

class GatewayTest : public testing::Test {
 protected:
  GatewayTest() {
    std::filesystem::create_directory(folder_.path() / "volumes");
    std::ofstream(folder_.path() / "secret.txt") << "secret";
    std::ofstream(folder_.path() / "volumes" / "run-1.vtkhdf") << "volume bytes";
    std::filesystem::create_symlink(folder_.path() / "secret.txt", folder_.path() / "volumes" / "link.txt");
    GatewaySources sources;
    sources.status_json = [] { return std::string("{\"array\":{\"state\":\"idle\"}}"); };
    sources.runs_json = []() -> std::string { throw std::runtime_error("ledger closed"); };
    sources.run_json = [](std::string_view id) {
      return id == "7" ? std::optional<std::string>("{\"id\":7}") : std::nullopt;
    };
    sources.preview_png = [](std::string_view camera) {
      return camera == "cam 00" ? std::optional<std::string>("png bytes") : std::nullopt;
    };
    sources.volumes_folder = folder_.path() / "volumes";
    auto gateway = Gateway::open({.port = 0, .threads = 2, .timeout_s = 1}, sources);
    if (!gateway) throw std::runtime_error(gateway.error().message);
    gateway_ = std::move(*gateway);
    port_ = static_cast<std::uint16_t>(std::stoi(gateway_->url().substr(gateway_->url().rfind(':') + 1)));
    thread_ = std::jthread([this](std::stop_token stop) { gateway_->run(std::move(stop)); });
  }

  std::string get(const std::string& target) {
    return exchange("GET " + target + " HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  }
  std::string exchange(const std::string& request) {
    Client client(port_);
    client.send(request);
    return client.receive_all();
  }

  ScratchFolder folder_;
  std::unique_ptr<Gateway> gateway_;
  std::uint16_t port_ = 0;
  std::jthread thread_;
};

TEST_F(GatewayTest, ServesThePageAndTheStatus) {
  const std::string page = get("/");
  EXPECT_TRUE(page.starts_with("HTTP/1.1 200"));
  EXPECT_TRUE(contains(page, "text/html"));
  EXPECT_TRUE(page.ends_with("</html>\n"));
  EXPECT_TRUE(contains(page, "Content-Security-Policy"));
  const std::string status = get("/api/v1/status?x=1");
  EXPECT_TRUE(status.starts_with("HTTP/1.1 200"));
  EXPECT_TRUE(contains(status, "application/json"));
  EXPECT_TRUE(status.ends_with("{\"array\":{\"state\":\"idle\"}}"));
}

TEST_F(GatewayTest, NamesInThePathAreDecodedAndUnknownOnesAreNotFound) {
  EXPECT_TRUE(get("/api/v1/runs/7").ends_with("{\"id\":7}"));
  EXPECT_TRUE(get("/api/v1/preview/cam%2000.png").ends_with("png bytes"));
  for (const char* missing : {"/api/v1/runs/8", "/api/v1/preview/cam99.png", "/api/v1/preview/.png",
                              "/favicon.ico", "/api/v1/captures/x/receipt", "/api/v1/volume.png",
                              "/report/report.html", "/volumes/", "/volumes/none.vtkhdf"}) {
    EXPECT_TRUE(get(missing).starts_with("HTTP/1.1 404")) << missing;
  }
}

TEST_F(GatewayTest, ServesFilesOfTheFolderAndNothingOutsideOfIt) {
  EXPECT_TRUE(get("/volumes/run-1.vtkhdf").ends_with("volume bytes"));
  for (const char* path :
       {"/volumes/../secret.txt", "/volumes/%2e%2e/secret.txt", "/volumes/..%2fsecret.txt",
        "/volumes/x/../../secret.txt", "/volumes//etc/passwd", "/volumes/%2Fetc/passwd",
        "/volumes/..%5csecret.txt", "/volumes/link.txt", "/volumes/run-1.vtkhdf%00.txt", "/volumes/%zz"}) {
    const std::string answer = get(path);
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 40")) << path;
    EXPECT_FALSE(answer.ends_with("secret") || contains(answer, "root:")) << path;
  }
}

TEST_F(GatewayTest, ALargeFileArrivesWhole) {
  std::string bytes(20'000'000, 'a');
  for (std::size_t i = 0; i < bytes.size(); i += 997) bytes[i] = static_cast<char>('b' + i % 20);
  std::ofstream(folder_.path() / "volumes" / "big.vtkhdf", std::ios::binary) << bytes;
  const std::string answer = get("/volumes/big.vtkhdf");
  ASSERT_GT(answer.size(), bytes.size());
  EXPECT_EQ(answer.substr(answer.size() - bytes.size()), bytes);
}

TEST_F(GatewayTest, OnlyGetIsAllowed) {
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS"}) {
    const std::string answer =
        exchange(concat(method, " / HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"));
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 405")) << method;
    EXPECT_TRUE(contains(answer, "Allow: GET"));
  }
}

TEST_F(GatewayTest, OversizeRequestsAreRefused) {
  EXPECT_TRUE(
      exchange("GET / HTTP/1.1\r\nX: " + std::string(20000, 'x') + "\r\n\r\n").starts_with("HTTP/1.1 431"));
  EXPECT_TRUE(exchange("POST / HTTP/1.1\r\nContent-Length: 100000\r\n\r\n").starts_with("HTTP/1.1 413"));
}

TEST_F(GatewayTest, WhatIsNotHttpIsRefusedAndTheNextClientIsServed) {
  EXPECT_TRUE(exchange("\x01\x02 nonsense\r\n\r\n").starts_with("HTTP/1.1 400"));
  EXPECT_TRUE(get("/").starts_with("HTTP/1.1 200"));
}

TEST_F(GatewayTest, AFailingSourceIsAnErrorOfThatRequestOnly) {
  EXPECT_TRUE(get("/api/v1/runs").starts_with("HTTP/1.1 500"));
  EXPECT_TRUE(get("/api/v1/status").starts_with("HTTP/1.1 200"));
}

TEST_F(GatewayTest, AConnectionServesSeveralRequests) {
  Client client(port_);
  for (int i = 0; i < 3; ++i) {
    client.send("GET /api/v1/status HTTP/1.1\r\nHost: x\r\n\r\n");
    EXPECT_TRUE(contains(client.receive_until("\"idle\"}}"), "200"));
  }
}

TEST_F(GatewayTest, ClientsThatDawdleDoNotHoldUpTheOthers) {
  std::vector<std::unique_ptr<Client>> slow;
  for (int i = 0; i < 10; ++i) {
    slow.push_back(std::make_unique<Client>(port_));
    slow.back()->send("GET /api/v1/sta");
  }
  const auto start = std::chrono::steady_clock::now();
  EXPECT_TRUE(get("/api/v1/status").starts_with("HTTP/1.1 200"));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(1));
  slow[0]->send("tus HTTP/1.1\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(slow[0]->receive_all().starts_with("HTTP/1.1 200"));
}

TEST_F(GatewayTest, AClientThatSendsNothingIsLetGo) {
  Client client(port_);
  EXPECT_EQ(client.receive_all(),
            "");  // the server closes after timeout_s, before the client's own five seconds
  client.send("GET / HTTP/1.1\r\nConnection: close\r\n\r\n");
  EXPECT_EQ(client.receive_all(), "");
}

TEST_F(GatewayTest, StopsAtOnceWithConnectionsOpen) {
  Client client(port_);
  client.send("GET / HT");
  const auto start = std::chrono::steady_clock::now();
  thread_.request_stop();
  thread_.join();
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(1));
}

TEST_F(GatewayTest, APortInUseIsAnErrorThatNamesIt) {
  const auto second = Gateway::open({.port = port_}, {});
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::Unavailable);
  EXPECT_TRUE(contains(second.error().message, concat("127.0.0.1:", port_)));
}

TEST(GatewayOptions, AnAddressThatIsNotOneIsRefused) {
  const auto gateway = Gateway::open({.address = "localhost", .port = 0}, {});
  ASSERT_FALSE(gateway);
  EXPECT_EQ(gateway.error().code, ErrorCode::InvalidInput);
}

TEST(PercentDecoding, RefusesWhatIsBroken) {
  EXPECT_EQ(percent_decoded("/a%20b%2Fc").value_or("none"), "/a b/c");
  for (const char* broken : {"%", "%1", "%zz", "/a%00", "a%2"})
    EXPECT_FALSE(percent_decoded(broken)) << broken;
}

}  // namespace
}  // namespace flamefield
