#include "services/bus/bus.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <optional>

#include "services/bus/client.h"
#include "tests/services/raw_socket.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;
using testing_support::make_set;
using testing_support::same_pixels;

constexpr const char* kAnyPort = "tcp://127.0.0.1:*";

Router bound_router(Bus& bus, const std::string& endpoint) {
  Router router(bus);
  EXPECT_TRUE(router.bind(endpoint));
  return router;
}

Dealer connected_dealer(Bus& bus, const std::string& role, const std::string& endpoint) {
  Dealer dealer(bus, role, unique_name(role));
  EXPECT_TRUE(dealer.connect(endpoint));
  return dealer;
}

// One message there and one back, pixels included, on any transport.
void expect_conversation(Router& router, Dealer& dealer, const std::string& role) {
  const FrameSet set = make_set("burst", 4, 64);
  ASSERT_TRUE(dealer.send(PutSet{set}, 7));
  auto arrived = router.receive(5s);
  ASSERT_TRUE(arrived);
  ASSERT_TRUE(arrived->message) << arrived->message.error().message;
  EXPECT_EQ(arrived->peer, dealer.name());
  EXPECT_EQ(arrived->role, role);
  EXPECT_EQ(arrived->request, 7u);
  EXPECT_TRUE(same_pixels(std::get<PutSet>(*arrived->message).set, set));
  ASSERT_TRUE(router.send(arrived->peer, SetStored{{"burst", 4}, false}, 7));
  auto answer = dealer.receive(5s);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->request, 7u);
  EXPECT_TRUE(std::holds_alternative<SetStored>(*answer->message));
}

TEST(Bus, CarriesSetsWithinOneProcess) {
  Bus bus;
  Router router = bound_router(bus, "inproc://dispatcher");
  Dealer dealer = connected_dealer(bus, "capture", "inproc://dispatcher");
  expect_conversation(router, dealer, "local");
}

TEST(Bus, CarriesSetsOverTcpAndNamesTheRoleOfTheKey) {
  Scratch keys;
  Bus server(KeyRing::open_or_create(keys.path()).value());
  Router router = bound_router(server, kAnyPort);
  for (const char* role : {"capture", "worker", "operator", "viewer"}) {
    Bus client(KeyRing::open(keys.path(), role).value());
    Dealer dealer = connected_dealer(client, role, router.bound_endpoint());
    expect_conversation(router, dealer, role);
  }
}

TEST(Bus, CarriesSetsOverLocalSockets) {
  Scratch keys;
  Bus bus(KeyRing::open_or_create(keys.path()).value());
  Router router = bound_router(bus, "ipc://" + (keys.path() / "bus").string());
  Dealer dealer = connected_dealer(bus, "worker", router.bound_endpoint());
  expect_conversation(router, dealer, "worker");
}

TEST(Bus, OneSocketServesThreadsAndTheNetworkAtOnce) {
  Scratch keys;
  Bus bus(KeyRing::open_or_create(keys.path()).value());
  Router router = bound_router(bus, "inproc://dispatcher");
  ASSERT_TRUE(router.bind(kAnyPort));
  Dealer near = connected_dealer(bus, "capture", "inproc://dispatcher");
  Dealer far = connected_dealer(bus, "capture", router.bound_endpoint());
  expect_conversation(router, near, "local");
  expect_conversation(router, far, "capture");
}

// A stranger knows the server's public key, but is not on the list. Somebody who is gets through meanwhile:
// so the stranger's silence is not just slowness.
TEST(Bus, AnUnknownKeyIsLeftOutside) {
  Scratch keys, strange_keys;
  Bus server(KeyRing::open_or_create(keys.path()).value());
  Router router = bound_router(server, kAnyPort);

  ASSERT_TRUE(KeyRing::open_or_create(strange_keys.path()));
  std::filesystem::copy_file(keys.path() / "dispatcher.pub", strange_keys.path() / "dispatcher.pub",
                             std::filesystem::copy_options::overwrite_existing);
  Bus outside(KeyRing::open(strange_keys.path(), "worker").value());
  Dealer stranger = connected_dealer(outside, "worker", router.bound_endpoint());
  ASSERT_TRUE(stranger.send(GetStatus{}, 1));

  Bus inside(KeyRing::open(keys.path(), "worker").value());
  Dealer friendly = connected_dealer(inside, "worker", router.bound_endpoint());
  ASSERT_TRUE(friendly.send(GetStatus{}, 2));
  const auto first = router.receive(5s);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->peer, friendly.name());
  EXPECT_FALSE(router.receive(500ms)) << "the stranger came through";
}

TEST(Bus, AKeyAddedToTheListIsLetIn) {
  Scratch keys, remote;
  ASSERT_TRUE(KeyRing::open_or_create(keys.path()));
  ASSERT_TRUE(KeyRing::open_or_create(remote.path()));
  std::filesystem::copy_file(remote.path() / "worker.pub", keys.path() / "worker-node7.pub");
  std::filesystem::copy_file(keys.path() / "dispatcher.pub", remote.path() / "dispatcher.pub",
                             std::filesystem::copy_options::overwrite_existing);
  Bus server(KeyRing::open_or_create(keys.path()).value());
  Router router = bound_router(server, kAnyPort);
  Bus client(KeyRing::open(remote.path(), "worker").value());
  Dealer dealer = connected_dealer(client, "worker", router.bound_endpoint());
  expect_conversation(router, dealer, "worker");
}

TEST(Bus, WithoutKeysOnlyThreadsOfTheProcessCanTalk) {
  Bus bus;
  Router router(bus);
  const auto refused = router.bind(kAnyPort);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::InvalidInput);
}

TEST(Bus, AnEndpointInUseIsUnavailableAndNamed) {
  Scratch keys;
  Bus bus(KeyRing::open_or_create(keys.path()).value());
  Router first = bound_router(bus, kAnyPort);
  Router second(bus);
  const auto refused = second.bind(first.bound_endpoint());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::Unavailable);
  EXPECT_NE(refused.error().message.find(first.bound_endpoint()), std::string::npos);
}

TEST(Bus, ConnectionsToARouterThatClosesDoNotStopTheOthers) {
  Scratch keys;
  Bus bus(KeyRing::open_or_create(keys.path()).value());
  for (int round = 0; round < 300; ++round) {
    std::optional<Router> closing = bound_router(bus, kAnyPort);
    const std::uint16_t port = testing_support::port_of(closing->bound_endpoint());
    const testing_support::RawSocket first(port), second(port), third(port);
    closing.reset();
  }
  Router router = bound_router(bus, kAnyPort);
  Dealer dealer = connected_dealer(bus, "capture", router.bound_endpoint());
  expect_conversation(router, dealer, "capture");
}

TEST(Bus, AMalformedEndpointIsInvalid) {
  Bus bus;
  Router router(bus);
  const auto refused = router.bind("inproc//dispatcher");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::InvalidInput);
}

TEST(Bus, SendingToAPeerThatLeftIsAnError) {
  Bus bus;
  Router router = bound_router(bus, "inproc://dispatcher");
  const auto refused = router.send("nobody", Accepted{});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::Unavailable);
}

TEST(Bus, NewsReachSubscribers) {
  Bus bus;
  Publisher publisher(bus);
  ASSERT_TRUE(publisher.bind("inproc://events"));
  Subscriber subscriber(bus);
  ASSERT_TRUE(subscriber.connect("inproc://events"));
  std::optional<Delivery> got;
  EXPECT_TRUE(testing_support::eventually([&] {
    publisher.publish(Event{1, "set-stored", "burst", ""});
    got = subscriber.receive(10ms);
    return got.has_value();
  }));
  EXPECT_EQ(std::get<Event>(*got->message).kind, "set-stored");
}

TEST(Client, AQuestionWithoutAnAnswerIsUnavailable) {
  Bus bus;
  Router router = bound_router(bus, "inproc://dispatcher");
  auto client = Client::connect(bus, "operator", "c", "inproc://dispatcher");
  const auto answer = client->ask(GetStatus{}, 20ms);
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::Unavailable);
}

TEST(Client, MessagesThatAnswerNothingWaitForNext) {
  Bus bus;
  Router router = bound_router(bus, "inproc://dispatcher");
  auto client = Client::connect(bus, "operator", "c", "inproc://dispatcher");
  std::jthread server([&] {
    auto question = router.receive(5s);
    ASSERT_TRUE(question);
    (void)router.send("c", LeaseLost{3});
    (void)router.send("c", Status{}, question->request);
  });
  EXPECT_TRUE(client->ask_for<Status>(GetStatus{}, 5s));
  const auto next = client->next(0ms);
  ASSERT_TRUE(next);
  EXPECT_EQ(std::get<LeaseLost>(*next).token, 3);
}

TEST(Keys, ASecretThatOthersCanReadIsRefused) {
  Scratch keys;
  ASSERT_TRUE(KeyRing::open_or_create(keys.path()));
  struct stat info {};
  ASSERT_EQ(::stat((keys.path() / "worker.key").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0600u);
  ASSERT_EQ(::chmod((keys.path() / "worker.key").c_str(), 0644), 0);
  const auto refused = KeyRing::open(keys.path(), "worker");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("chmod 600"), std::string::npos);
}

TEST(Keys, ADamagedKeyFileIsNamed) {
  Scratch keys;
  ASSERT_TRUE(KeyRing::open_or_create(keys.path()));
  std::ofstream(keys.path() / "worker-x.pub") << "not a key\n";
  const auto refused = KeyRing::open_or_create(keys.path());
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("worker-x.pub"), std::string::npos);
}

TEST(Keys, StayTheSameWhenOpenedAgain) {
  Scratch keys;
  const auto first = KeyRing::open_or_create(keys.path());
  const auto second = KeyRing::open_or_create(keys.path());
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->of("dispatcher").secret_key, second->of("dispatcher").secret_key);
  EXPECT_EQ(first->allowed(), second->allowed());
}

}  // namespace
}  // namespace flamefield
