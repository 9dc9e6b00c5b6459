// Strangers, liars and eavesdroppers at the bus: refused, counted, and nobody else notices.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>
#include <fstream>
#include <random>
#include <zmq.hpp>

#include "services/bus/client.h"
#include "services/bus/roles.h"
#include "services/dispatcher/dispatcher.h"
#include "services/log/log.h"
#include "tests/services/chaos.h"
#include "tests/services/raw_socket.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;
using testing_support::eventually;
using testing_support::make_set;
using testing_support::port_of;
using testing_support::RawSocket;
using testing_support::Wiretap;

// ZMTP 3.0, section 3: signature, version, mechanism, as-server, filler.
std::string greeting(std::string mechanism) {
  mechanism.resize(20, '\0');
  return std::string("\xff\0\0\0\0\0\0\0\x01\x7f", 10) + "\x03" + std::string(1, '\0') + mechanism +
         std::string(32, '\0');
}

// A frame's header that announces `bytes` of body: flags "long", size in network order.
std::string announcement(std::uint64_t bytes) {
  std::string header(1, '\x02');
  for (int shift = 56; shift >= 0; shift -= 8) header += static_cast<char>((bytes >> shift) & 255);
  return header;
}

double peak_rss_mib() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

// A dispatcher on the network, and somebody with a good key.
class HostileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    set_log_level(LogLevel::Error);
    bus_.emplace(KeyRing::open_or_create(keys()).value());
    auto opened = Dispatcher::open(
        *bus_,
        {.data_dir = scratch_.path() / "data", .endpoints = {"tcp://127.0.0.1:*"}, .event_endpoints = {}});
    ASSERT_TRUE(opened) << opened.error().message;
    dispatcher_ = std::move(*opened);
    thread_ = std::jthread([this](std::stop_token stop) { (void)dispatcher_->run(stop); });
    friend_bus_.emplace(KeyRing::open(keys(), "operator").value());
    friend_.emplace(Client::connect(*friend_bus_, "operator", "friend", endpoint()).value());
    ASSERT_TRUE(status());
  }
  void TearDown() override {
    friend_.reset();
    thread_ = {};
    dispatcher_.reset();
  }

  std::filesystem::path keys() const { return scratch_.path() / "keys"; }
  std::string endpoint() const { return dispatcher_->endpoints()[0]; }
  std::uint16_t port() const { return port_of(endpoint()); }
  Result<Status> status() { return friend_->ask_for<Status>(GetStatus{}, 10s); }
  std::int64_t counted(const std::string& name) {
    auto now = status();
    EXPECT_TRUE(now) << "the service does not answer";
    return now ? now->counters[name] : -1;
  }
  // A pair of keys in a directory of its own that knows the dispatcher's public key.
  std::filesystem::path strange_keys(const std::string& role) {
    const auto out = scratch_.path() / ("strange-" + role);
    EXPECT_TRUE(make_keys_for(keys(), role, out));
    return out;
  }

  Scratch scratch_;
  std::optional<Bus> bus_, friend_bus_;
  std::unique_ptr<Dispatcher> dispatcher_;
  std::optional<Client> friend_;
  std::jthread thread_;
};

TEST_F(HostileTest, WhoBringsNoKeyIsRefusedAndCounted) {
  const std::int64_t before = counted("bus_connections_refused");
  RawSocket stranger(port());
  stranger.send(greeting("NULL"));
  stranger.send(
      std::string("\x04\x1c\x05READY\x0bSocket-Type\0\0\0\x06"
                  "DEALER",
                  30));
  EXPECT_TRUE(stranger.is_closed_within(10s));
  EXPECT_TRUE(eventually([&] { return counted("bus_connections_refused") > before; }));
}

TEST_F(HostileTest, AnUnlistedKeyIsRefusedAndCounted) {
  Bus outside(KeyRing::open(strange_keys("operator"), "operator").value());
  auto stranger = Client::connect(outside, "operator", "stranger", endpoint());
  EXPECT_FALSE(stranger->ask(GetStatus{}, 500ms));
  EXPECT_GE(counted("bus_keys_refused"), 1);
}

TEST_F(HostileTest, AKeyIsLetInAndTurnedAwayWhileTheServiceRuns) {
  const auto strange = strange_keys("viewer");
  ASSERT_TRUE(allow_key(keys(), "viewer", "guest", strange / "viewer.pub"));
  EXPECT_FALSE(allow_key(keys(), "viewer", "guest", strange / "viewer.pub")) << "the name is taken";
  EXPECT_FALSE(allow_key(keys(), "king", "x", strange / "viewer.pub"));
  EXPECT_FALSE(allow_key(keys(), "viewer", "../x", strange / "viewer.pub"));
  Bus outside(KeyRing::open(strange, "viewer").value());
  auto guest = Client::connect(outside, "viewer", "guest", endpoint());
  EXPECT_TRUE(eventually([&] { return guest->ask(GetStatus{}, 1s).has_value(); }));
  ASSERT_TRUE(revoke_key(keys(), "viewer", "guest"));
  EXPECT_FALSE(revoke_key(keys(), "viewer", "guest"));
  EXPECT_TRUE(eventually([&] { return !guest->ask(GetStatus{}, 1s).has_value(); }))
      << "its connection is still open";
  EXPECT_GE(counted("bus_messages_revoked"), 1);
}

TEST_F(HostileTest, AViewerMaySeeAndNothingElse) {
  Bus bus(KeyRing::open(keys(), "viewer").value());
  auto viewer = Client::connect(bus, "viewer", "viewer", endpoint());
  EXPECT_TRUE(viewer->ask(GetStatus{}, 5s));
  Submit order;
  order.captures = {"burst"};
  order.processing = testing_support::make_processing();
  for (const Message& message : std::vector<Message>{order, PutSet{make_set("burst", 0)}, DropSchedule{"x"},
                                                     PutRig{testing_support::make_rig()}, Retire{{"x"}}}) {
    const auto refused = viewer->ask(message, 5s);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message.find("a viewer may not"), std::string::npos) << refused.error().message;
  }
  EXPECT_GE(counted("messages_forbidden"), 5);
  EXPECT_EQ(status()->sets, 0);
}

TEST(Roles, EachMayDoItsOwnWorkOnly) {
  EXPECT_FALSE(may_send("worker", StartCapture{}));
  EXPECT_FALSE(may_send("worker", Submit{}));
  EXPECT_FALSE(may_send("worker", PutSet{}));
  EXPECT_TRUE(may_send("worker", Finish{}));
  EXPECT_FALSE(may_send("viewer", StartCapture{}));
  EXPECT_FALSE(may_send("viewer", StopCapture{}));
  EXPECT_TRUE(may_send("viewer", GetPreview{}));
  EXPECT_FALSE(may_send("capture", Submit{}));
  EXPECT_TRUE(may_send("capture", PutSet{}));
  EXPECT_TRUE(may_send("operator", StartCapture{}));
  EXPECT_FALSE(may_send("operator", Finish{}));
  EXPECT_FALSE(may_send("operator", PutSet{}));
  EXPECT_FALSE(may_send("", GetStatus{}));
  EXPECT_FALSE(may_send("king", GetStatus{}));
}

// CurveZMQ: each connection has fresh keys of its own, so yesterday's bytes open nothing.
TEST_F(HostileTest, AReplayedConversationIsRefused) {
  std::string heard;
  {
    Wiretap tap(port());
    auto spied = Client::connect(*friend_bus_, "operator", "spied", concat("tcp://127.0.0.1:", tap.port()));
    ASSERT_TRUE(spied->ask(PutRig{testing_support::make_rig()}, 10s));
    heard = tap.heard();
  }
  ASSERT_GT(heard.size(), 64u + 200u) << "greeting, HELLO, INITIATE, a message";
  const std::int64_t refused = counted("bus_connections_refused");
  const std::int64_t malformed = counted("messages_malformed");
  RawSocket replay(port());
  replay.send(heard);
  EXPECT_TRUE(replay.is_closed_within(15s));
  EXPECT_TRUE(eventually([&] { return counted("bus_connections_refused") > refused; }));
  EXPECT_EQ(counted("messages_malformed"), malformed) << "nothing of it was taken for a message";
}

TEST_F(HostileTest, AMessageSentTwiceWithinAConnectionEndsIt) {
  Wiretap tap(port());
  auto spied = Client::connect(*friend_bus_, "operator", "spied", concat("tcp://127.0.0.1:", tap.port()));
  ASSERT_TRUE(spied->ask(GetStatus{}, 10s));
  const std::size_t before = tap.heard().size();
  ASSERT_TRUE(spied->ask(GetStatus{}, 10s));
  tap.inject(tap.heard().substr(before));  // nonces must grow
  EXPECT_TRUE(eventually([&] { return tap.server_closed(); }));
  EXPECT_TRUE(status());
}

TEST_F(HostileTest, AnAnnouncedGiganticMessageIsRefusedWithoutMemory) {
  const double before_mib = peak_rss_mib();
  const std::int64_t refused = counted("bus_connections_refused");
  for (const std::uint64_t bytes : {std::uint64_t{1} << 31, std::uint64_t{1} << 40, ~std::uint64_t{0}}) {
    RawSocket stranger(port());
    stranger.send(greeting("CURVE"));
    stranger.send(announcement(bytes));
    EXPECT_TRUE(stranger.is_closed_within(15s)) << bytes;
  }
  EXPECT_TRUE(eventually([&] { return counted("bus_connections_refused") >= refused + 3; }));
  // And from within a connection that had got through.
  Wiretap tap(port());
  auto spied = Client::connect(*friend_bus_, "operator", "spied", concat("tcp://127.0.0.1:", tap.port()));
  ASSERT_TRUE(spied->ask(GetStatus{}, 10s));
  tap.inject(announcement(std::uint64_t{1} << 31));
  EXPECT_TRUE(eventually([&] { return tap.server_closed(); }));
  EXPECT_TRUE(status());
  EXPECT_LT(peak_rss_mib() - before_mib, 256);
}

TEST_F(HostileTest, NoiseOnTheWireHarmsNobody) {
  std::mt19937 random(20260301);
  for (int n = 0; n < 100; ++n) {
    RawSocket stranger(port());
    std::string bytes = n % 3 == 0 ? "" : greeting(n % 3 == 1 ? "CURVE" : "PLAIN");
    const std::size_t length = random() % 600;
    for (std::size_t i = 0; i < length; ++i) bytes += static_cast<char>(random());
    if (random() % 2 == 0 && bytes.size() > 4) bytes.resize(random() % bytes.size());
    stranger.send(bytes);
    if (n % 10 == 0) {
      ASSERT_TRUE(status()) << "after connection " << n;
    }
  }
  EXPECT_TRUE(status());
}

// The right key, but what it sends is no message: answered or dropped, counted, and the next one is served.
TEST_F(HostileTest, MalformedMessagesOfAGoodKeyAreCounted) {
  const KeyRing ring = KeyRing::open(keys(), "operator").value();
  zmq::context_t context;
  zmq::socket_t dealer(context, zmq::socket_type::dealer);
  dealer.set(zmq::sockopt::linger, 0);
  dealer.set(zmq::sockopt::curve_publickey, ring.of("operator").public_key);
  dealer.set(zmq::sockopt::curve_secretkey, ring.of("operator").secret_key);
  dealer.set(zmq::sockopt::curve_serverkey, ring.dispatcher_public_key());
  dealer.connect(endpoint());
  std::mt19937 random(7);
  const std::string good = encode(PutRig{testing_support::make_rig()}, 5);
  constexpr int kMessages = 300;
  for (int n = 0; n < kMessages; ++n) {
    std::string bytes = n % 2 ? good : std::string();
    for (int i = 0; i < 20 && !bytes.empty(); ++i)
      bytes[random() % bytes.size()] = static_cast<char>(random());
    if (bytes.empty()) {
      for (std::size_t i = random() % 200; i > 0; --i) bytes += static_cast<char>(random());
    }
    const int parts = 1 + static_cast<int>(random() % 4);
    for (int part = 0; part < parts; ++part)
      dealer.send(zmq::buffer(part == 0 ? bytes : std::string(random() % 100, 'x')),
                  part + 1 < parts ? zmq::send_flags::sndmore : zmq::send_flags::none);
  }
  EXPECT_TRUE(eventually([&] { return counted("messages_malformed") >= kMessages / 2; }));
}

TEST_F(HostileTest, ASilentConnectionIsClosed) {
  RawSocket dawdler(port());
  dawdler.send(greeting("CURVE").substr(0, 20));
  EXPECT_TRUE(dawdler.is_closed_within(20s));
}

// The programs' logs, with every kind of refusal in them, hold no secret.
TEST(Programs, LogsHoldNoSecrets) {
  Scratch scratch;
  const std::string data = scratch.path().string();
  const auto log = scratch.path() / "log";
  {
    testing_support::Process dispatcher("flamefield-dispatchd",
                                        {"--data", data, "--endpoint", "tcp://127.0.0.1:*"}, log);
    ASSERT_TRUE(
        eventually([&] { return std::filesystem::exists(scratch.path() / "run" / "dispatcher.sock"); }));
    testing_support::Process worker("flamefield-worker", {"--data", data}, log);
    Bus bus(KeyRing::open(scratch.path() / "keys", "viewer").value());
    auto viewer = Client::connect(bus, "viewer", "v", "ipc://" + data + "/run/dispatcher.sock");
    EXPECT_TRUE(eventually([&] {
      const auto status = viewer->ask_for<Status>(GetStatus{}, 1s);
      return status && !status->workers.empty();
    }));
    EXPECT_FALSE(viewer->ask(DropSchedule{"x"}, 5s));
    worker.signal(SIGTERM);
    EXPECT_EQ(worker.wait(), 0);
    dispatcher.signal(SIGTERM);
    EXPECT_EQ(dispatcher.wait(), 0);
  }
  std::ifstream in(log);
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  EXPECT_NE(text.find("dispatcher-started"), std::string::npos) << text;
  for (const char* role : {"dispatcher", "capture", "worker", "operator", "viewer"}) {
    const auto file = scratch.path() / "keys" / concat(role, ".key");
    struct stat info {};
    ASSERT_EQ(::stat(file.c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777, 0600u) << role;
    std::ifstream key(file);
    std::string secret;
    std::getline(key, secret);
    ASSERT_EQ(secret.size(), 40u);
    EXPECT_EQ(text.find(secret), std::string::npos) << role;
  }
}

}  // namespace
}  // namespace flamefield
