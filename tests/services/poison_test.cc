#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <map>
#include <set>

#include "services/bus/client.h"
#include "services/dispatcher/dispatcher.h"
#include "services/log/log.h"
#include "services/process/supervisor.h"
#include "services/selftest/child_process.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;
using testing_support::eventually;
using testing_support::make_processing;
using testing_support::make_rig;
using testing_support::make_set;

TEST(Poison, AJobThatKillsProcessesKillsOneWorkerTwiceAndAllOthersAreDone) {
  set_log_level(LogLevel::Error);
  const Scratch scratch;
  Bus bus(KeyRing::open_or_create(scratch / "keys").value());
  const std::string endpoint = "ipc://" + (scratch / "bus").string();
  auto dispatcher = Dispatcher::open(bus, {.data_dir = scratch.path(),
                                           .endpoints = {endpoint},
                                           .event_endpoints = {},
                                           .lease = 2s,
                                           .back_off = 10ms});
  ASSERT_TRUE(dispatcher) << dispatcher.error().message;
  const std::jthread serving([&](std::stop_token stop) { (void)(*dispatcher)->run(stop); });
  auto client = Client::connect(bus, "operator", "c", endpoint);
  auto producer = Client::connect(bus, "capture", "p", endpoint);
  ASSERT_TRUE(client->ask(PutRig{make_rig()}, 5s));
  for (int i = 0; i < 8; ++i) ASSERT_TRUE(producer->ask(PutSet{make_set("burst", i)}, 5s));
  Submit order;
  order.captures = {"burst"};
  order.processing = make_processing();
  ASSERT_TRUE(client->ask(order, 5s));
  std::vector<ChildProcess> workers;
  for (int i = 0; i < 2; ++i)
    workers.push_back(
        ChildProcess::start(FLAMEFIELD_POISON_WORKER, {scratch.path(), endpoint}, scratch / "log").value());
  Status status;
  EXPECT_TRUE(eventually([&] {
    status = client->ask_for<Status>(GetStatus{}, 5s).value_or(Status{});
    return status.done == 7 && status.failed == 1;
  })) << status.done
      << " done, " << status.failed << " failed";
  std::ifstream file(scratch / "attempts");
  std::set<std::string> killed;
  int deaths = 0;
  std::string worker;
  for (int set = 0; file >> set >> worker;) {
    if (set != 3) continue;
    ++deaths;
    killed.insert(worker);
  }
  EXPECT_EQ(deaths, 2);
  EXPECT_EQ(killed.size(), 1u) << "the second attempt was the same worker's";
  const auto dead = client->ask_for<Jobs>(GetJobs{.state = JobState::Failed}, 5s);
  ASSERT_TRUE(dead);
  EXPECT_NE(dead->rows.at(0).why.find("signal 11"), std::string::npos) << dead->rows.at(0).why;
  workers[0].signal(SIGTERM);
  EXPECT_EQ(workers[0].wait(), 0) << "a watched worker stops as others do";
}

}  // namespace
}  // namespace flamefield
