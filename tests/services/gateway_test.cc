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
  std::string receive(std::size_t bytes) {
    std::string out(bytes, ' ');
    std::size_t have = 0;
    for (ssize_t n; have < bytes && (n = recv(socket_, out.data() + have, bytes - have, 0)) > 0;)
      have += static_cast<std::size_t>(n);
    out.resize(have);
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
    sources.api = [](std::string_view path, const HttpRequest& request) -> std::optional<HttpResponse> {
      if (path == "fails") throw std::runtime_error("ledger closed");
      if (path == "runs/a b") return HttpResponse{200, "application/json", "{\"id\":7}", {}, {}};
      if (path == "status") return HttpResponse{200, "application/json", "{\"idle\"}", {}, {}};
      if (path == "capture" && request.method == "POST")
        return HttpResponse{202, "application/json", request.body, {}, {}};
      return std::nullopt;
    };
    sources.volumes_folder = folder_.path() / "volumes";
    HttpServerOptions options{.port = 0, .threads = 2, .timeout_s = 2};
    options.board = &board_;
    auto gateway = Gateway::open(options, kToken, sources);
    if (!gateway) throw std::runtime_error(gateway.error().message);
    gateway_ = std::move(*gateway);
    port_ = static_cast<std::uint16_t>(std::stoi(gateway_->url().substr(gateway_->url().rfind(':') + 1)));
    thread_ = std::jthread([this](std::stop_token stop) { gateway_->run(std::move(stop)); });
  }

  std::string get(const std::string& target) {
    return exchange("GET " + target + " HTTP/1.1\r\nConnection: close\r\n\r\n");
  }
  std::string exchange(const std::string& request) {
    Client client(port_);
    client.send(request);
    return client.receive_all();
  }

  static constexpr const char* kToken = "0123456789abcdef";
  std::string host() const { return concat("127.0.0.1:", port_); }
  // A command as a page of ours sends it, with `headers` in place of the usual ones where given.
  std::string command(const std::string& headers, const std::string& type = "application/json") {
    return exchange(concat("POST /api/v1/capture HTTP/1.1\r\nHost: ", host(),
                           "\r\nConnection: close\r\nContent-Type: ", type, "\r\nContent-Length: 2\r\n",
                           headers, "\r\n{}"));
  }
  std::string cookie() const { return concat("Cookie: flamefield-", port_, "=", kToken, "\r\n"); }

  ScratchFolder folder_;
  NoticeBoard board_;
  std::unique_ptr<Gateway> gateway_;
  std::uint16_t port_ = 0;
  std::jthread thread_;
};

TEST_F(GatewayTest, ServesThePageAndTheStatus) {
  const std::string page = get("/");
  EXPECT_TRUE(page.starts_with("HTTP/1.1 200"));
  EXPECT_TRUE(contains(page, "text/html"));
  EXPECT_TRUE(page.ends_with("</html>\n"));
  EXPECT_TRUE(contains(page, "Content-Security-Policy: default-src 'none'"));
  EXPECT_FALSE(contains(page, "unsafe-inline"));
  EXPECT_TRUE(contains(get("/api/v1/openapi.json"), "\"openapi\": \"3.0.3\""));
  const std::string status = get("/api/v1/status?x=1");
  EXPECT_TRUE(status.starts_with("HTTP/1.1 200"));
  EXPECT_TRUE(contains(status, "application/json"));
  EXPECT_TRUE(status.ends_with("{\"idle\"}"));
}

TEST_F(GatewayTest, EveryFileThatThePageNamesIsServedAndMayBeKept) {
  const std::string page = get("/");
  int named = 0;
  for (std::size_t at = page.find("\"/assets/"); at != std::string::npos;
       at = page.find("\"/assets/", at + 1)) {
    const std::string path = page.substr(at + 1, page.find('"', at + 1) - at - 1);
    const std::string answer = get(path);
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 200")) << path;
    EXPECT_TRUE(contains(answer, "immutable")) << path;
    ++named;
  }
  if (named == 0) GTEST_SKIP() << "the front end was not built into this program";
}

TEST_F(GatewayTest, NamesInThePathAreDecodedAndUnknownOnesAreNotFound) {
  EXPECT_TRUE(get("/api/v1/runs/a%20b").ends_with("{\"id\":7}"));
  for (const char* missing : {"/api/v1/runs/8", "/api/v1/", "/api/v2/status", "/favicon.ico", "/index",
                              "/assets/", "/report/report.html", "/volumes/", "/volumes/none.vtkhdf"}) {
    EXPECT_TRUE(get(missing).starts_with("HTTP/1.1 404")) << missing;
  }
}

TEST_F(GatewayTest, CommandsNeedTheToken) {
  const std::string origin = concat("Origin: http://", host(), "\r\n");
  EXPECT_TRUE(command(origin + cookie()).starts_with("HTTP/1.1 202"));
  EXPECT_TRUE(command(concat("Authorization: Bearer ", kToken, "\r\n")).starts_with("HTTP/1.1 202"));
  EXPECT_TRUE(command(cookie() + "Sec-Fetch-Site: same-origin\r\n").starts_with("HTTP/1.1 202"));
  EXPECT_TRUE(command(origin).starts_with("HTTP/1.1 403"));
  EXPECT_TRUE(command("Authorization: Bearer 0123456789abcdee\r\n").starts_with("HTTP/1.1 403"));
  EXPECT_TRUE(command(origin + concat("Cookie: flamefield-1=", kToken, "\r\n")).starts_with("HTTP/1.1 403"));
}

TEST_F(GatewayTest, PagesOfOthersCannotCommandReadOrWatch) {
  const std::string evil = "Origin: http://evil.example\r\n";
  EXPECT_TRUE(command(evil + cookie()).starts_with("HTTP/1.1 403"));
  EXPECT_TRUE(command(cookie() + "Sec-Fetch-Site: cross-site\r\n").starts_with("HTTP/1.1 403"));
  EXPECT_TRUE(command(cookie()).starts_with("HTTP/1.1 403")) << "neither header: no browser of today";
  EXPECT_TRUE(command(cookie() + concat("Origin: http://", host(), "\r\n"), "text/plain")
                  .starts_with("HTTP/1.1 415"));
  const auto asked = [&](const std::string& headers) {
    return exchange("GET /api/v1/live HTTP/1.1\r\nConnection: close\r\n" + headers + "\r\n");
  };
  EXPECT_TRUE(asked("Host: " + host() + "\r\n" + evil).starts_with("HTTP/1.1 403"));
  EXPECT_TRUE(asked("Host: rebound.example\r\n").starts_with("HTTP/1.1 403"));
  EXPECT_TRUE(asked("Host: " + host() + "\r\n").starts_with("HTTP/1.1 426"));
}

TEST_F(GatewayTest, ThePageBringsTheTokenOnThisMachineOnly) {
  EXPECT_TRUE(
      contains(exchange(concat("GET / HTTP/1.1\r\nHost: ", host(), "\r\nConnection: close\r\n\r\n")),
               concat("Set-Cookie: flamefield-", port_, "=", kToken, "; Path=/; HttpOnly; SameSite=Strict")));
  const Guard proxied("secret", "lab.example");
  const HttpRequest plain{"GET", "/", "", {{"host", "lab.example"}}, ""},
      opened{"GET", "/", "token=secret", {{"host", "lab.example"}}, ""},
      guessed{"GET", "/", "token=secreT", {{"host", "lab.example"}}, ""};
  EXPECT_FALSE(proxied.cookie_for(plain));
  EXPECT_FALSE(proxied.cookie_for(guessed));
  ASSERT_TRUE(proxied.cookie_for(opened));
  EXPECT_TRUE(proxied.cookie_for(opened)->ends_with("; Secure"));
}

TEST(Guard, AProxyIsServedUnderItsNameAndNoOther) {
  const Guard proxied("secret", "lab.example"), alone("secret");
  const auto from = [](const std::string& host, const std::string& origin) {
    return HttpRequest{"POST", "/", "", {{"host", host}, {"origin", origin}}, ""};
  };
  EXPECT_FALSE(proxied.refuse(from("lab.example", "https://lab.example")));
  EXPECT_FALSE(proxied.refuse(from("127.0.0.1:8080", "http://127.0.0.1:8080")));
  EXPECT_TRUE(proxied.refuse(from("lab.example", "https://evil.example")));
  EXPECT_TRUE(proxied.refuse(from("evil.example", "https://evil.example")));
  EXPECT_TRUE(alone.refuse(from("lab.example", "https://lab.example")));
}

TEST_F(GatewayTest, AnUploadOfAGigabyteIsRefusedAtOnce) {
  const auto start = std::chrono::steady_clock::now();
  Client client(port_);
  client.send("POST /api/v1/capture HTTP/1.1\r\nHost: " + host() + "\r\nContent-Length: 1000000000\r\n\r\n" +
              std::string(1'000'000, 'x'));
  EXPECT_TRUE(client.receive_until("\r\n").starts_with("HTTP/1.1 413"));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(1));
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

TEST_F(GatewayTest, OnlyGetIsAllowedOutsideOfTheApi) {
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS"}) {
    const std::string answer =
        exchange(concat(method, " / HTTP/1.1\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"));
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
  EXPECT_TRUE(get("/api/v1/fails").starts_with("HTTP/1.1 500"));
  EXPECT_TRUE(get("/api/v1/status").starts_with("HTTP/1.1 200"));
}

TEST_F(GatewayTest, AConnectionServesSeveralRequests) {
  Client client(port_);
  for (int i = 0; i < 3; ++i) {
    client.send("GET /api/v1/status HTTP/1.1\r\n\r\n");
    EXPECT_TRUE(contains(client.receive_until("{\"idle\"}"), "200"));
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

// A WebSocket's client, spelt out like the other one (RFC 6455).
class Watching {
 public:
  Watching(std::uint16_t port, const std::string& host) : client_(port) {
    client_.send("GET /api/v1/live HTTP/1.1\r\nHost: " + host +
                 "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                 "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n");
    accepted_ = client_.receive_until("\r\n\r\n").starts_with("HTTP/1.1 101");
  }
  bool accepted() const { return accepted_; }
  Client& client() { return client_; }
  void say(const std::string& text) {  // masked with zeros
    client_.send(concat('\x81', static_cast<char>(0x80 | text.size()), std::string(4, '\0'), text));
  }
  // The next message that is no ping; empty when none comes.
  std::string hear() {
    for (;;) {
      const std::string head = client_.receive(2);
      if (head.size() < 2) return "";
      std::size_t size = static_cast<unsigned char>(head[1]);
      if (size >= 126) {
        const std::string more = client_.receive(size == 126 ? 2 : 8);
        size = 0;
        for (const char byte : more) size = size << 8 | static_cast<unsigned char>(byte);
      }
      std::string text = client_.receive(size);
      if ((head[0] & 0xf) < 8) return text;
    }
  }

 private:
  Client client_;
  bool accepted_ = false;
};

TEST_F(GatewayTest, WatchersHearTheNewestOfWhatTheyWant) {
  Watching watcher(port_, host());
  ASSERT_TRUE(watcher.accepted());
  board_.post("status", "one", false);
  watcher.say("want status volume");
  EXPECT_EQ(watcher.hear(), "one");
  board_.post("thumbnails", "not wanted", false);
  board_.post("status", "two", false);
  EXPECT_EQ(watcher.hear(), "two");
  board_.post("volume", std::string(200'000, 'v'), true);
  EXPECT_TRUE(watcher.hear() == std::string(200'000, 'v'));
}

TEST_F(GatewayTest, WhoDoesNotKeepUpMissesMessagesAndGetsTheNewest) {
  Watching slow(port_, host());
  slow.say("want volume");
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (!board_.is_watched("volume") && std::chrono::steady_clock::now() < end) std::this_thread::yield();
  for (int i = 0; i < 1000; ++i) board_.post("volume", concat("volume ", i), true);
  std::vector<std::string> heard = {slow.hear()};
  while (heard.back() != "volume 999" && heard.size() < 1000) {
    slow.say("got");
    heard.push_back(slow.hear());
  }
  EXPECT_LE(heard.size(), 3u) << "two may be on the way when it says that it keeps up";
  slow.say("got");
  board_.post("volume", "the newest", true);
  EXPECT_EQ(slow.hear(), "the newest");
}

TEST_F(GatewayTest, NobodyMakesWhatNobodyWatches) {
  auto watcher = std::make_unique<Watching>(port_, host());
  watcher->say("want status frame:cam03");
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (board_.watched("frame:").empty() && std::chrono::steady_clock::now() < end)
    std::this_thread::yield();
  EXPECT_EQ(board_.watched("frame:"), std::vector<std::string>{"frame:cam03"});
  watcher.reset();
  while (board_.is_watched("status") && std::chrono::steady_clock::now() < end) std::this_thread::yield();
  EXPECT_TRUE(board_.watched("").empty());
}

TEST_F(GatewayTest, MalformedFramesEndTheirConnectionOnly) {
  for (const std::string& bytes : {std::string("\xff\xff\xff\xff\xff\xff\xff\xff"),
                                   std::string("\x81\x05hello"), std::string("\x83\x80\0\0\0\0", 6),
                                   std::string("\x81\xff\x7f\xff\xff\xff\xff\xff\xff\xff\0\0\0\0", 14)}) {
    Watching bad(port_, host());
    ASSERT_TRUE(bad.accepted());
    bad.client().send(bytes);
    bad.client().receive_all();  // until closed
  }
  Watching good(port_, host());
  good.say("want status");
  board_.post("status", "still here", false);
  EXPECT_EQ(good.hear(), "still here");
}

TEST_F(GatewayTest, AWatcherThatStopsReadingIsLetGo) {
  Watching stuck(port_, host());
  stuck.say("want volume");
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (!board_.is_watched("volume") && std::chrono::steady_clock::now() < end) std::this_thread::yield();
  board_.post("volume", std::string(20'000'000, 'v'), true);  // more than the sockets hold
  while (board_.is_watched("volume") && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_FALSE(board_.is_watched("volume"));
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
  const auto second = Gateway::open({.port = port_}, kToken, {});
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::Unavailable);
  EXPECT_TRUE(contains(second.error().message, concat("127.0.0.1:", port_)));
}

TEST(GatewayOptions, AnAddressThatIsNotOneIsRefused) {
  const auto gateway = Gateway::open({.address = "localhost", .port = 0}, "", {});
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
