// The program that stores is killed with -9 again and again while sets pour in.
#include <gtest/gtest.h>

#include <optional>
#include <random>
#include <set>

#include "services/bus/client.h"
#include "services/dispatcher/set_sender.h"
#include "services/ledger/reader.h"
#include "services/store/file.h"
#include "tests/services/chaos.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;
using namespace testing_support;

TEST(StoringDaemon, EveryAcknowledgedSetIsReadableAfterTwentyKillsAndNoneIsThereTwice) {
  const unsigned seed = std::random_device()();
  SCOPED_TRACE(concat("seed ", seed));
  std::mt19937 random(seed);
  const Scratch scratch;
  const KeyRing keys = KeyRing::open_or_create(scratch / "keys").value();
  Bus bus(keys);
  const std::string endpoint = endpoint_to_keep(bus);
  const auto start = [&] {
    return Process("flamefield-dispatchd",
                   {"--data", scratch.path(), "--endpoint", endpoint, "--events",
                    "ipc://" + (scratch / "events").string()},
                   scratch / "log");
  };
  std::optional<Process> daemon = start();
  Dealer dealer(bus, "capture", unique_name("capture"));
  ASSERT_TRUE(dealer.connect(endpoint));
  SetSender sender(std::move(dealer), {.max_unacked = 32, .resend_after = kSlowdown * 200ms});

  std::int64_t sets = 0;
  for (int kills = 0; kills < 20; ++kills) {
    const std::int64_t acked_before = sender.acked();
    const auto start_time = std::chrono::steady_clock::now();
    const auto kill_at = start_time + std::chrono::milliseconds(20 + random() % 150);
    while (std::chrono::steady_clock::now() < kill_at || sender.acked() == acked_before) {
      ASSERT_LT(std::chrono::steady_clock::now(), start_time + kSlowdown * 30s)
          << "nothing is acknowledged after " << kills << " kills: " << sender.last_refusal() << '\n'
          << read_text_file(scratch / "log").value_or("");
      if (sender.offer(make_set("burst", sets, 256))) ++sets;
      sender.pump(2ms);
    }
    daemon.reset();  // with -9; the ledger takes one writer at a time
    daemon = start();
  }
  ASSERT_TRUE(sender.drain(kSlowdown * 30s)) << sender.last_refusal() << '\n'
                                             << read_text_file(scratch / "log").value_or("");
  ASSERT_GE(sets, 20);

  auto client = Client::connect(bus, "worker", unique_name("worker"), endpoint);
  ASSERT_TRUE(client);
  for (std::int64_t index = 0; index < sets; ++index) {
    const auto data = client->ask_for<SetData>(FetchSet{{"burst", index}}, kSlowdown * 10s);
    ASSERT_TRUE(data) << index << ": " << data.error().message;
    EXPECT_TRUE(same_pixels(data->set, make_set("burst", index, 256))) << index;
  }
  auto reader = LedgerReader::open(scratch.path());
  ASSERT_TRUE(reader) << reader.error().message;
  const auto rows = reader->sets("burst");
  ASSERT_TRUE(rows);
  std::set<std::int64_t> indices;
  for (const SetRow& row : *rows) EXPECT_TRUE(indices.insert(row.id.index).second) << row.id.index;
  EXPECT_EQ(static_cast<std::int64_t>(indices.size()), sets);
  std::printf("%ld sets, 20 kills, %ld sent again\n", static_cast<long>(sets),
              static_cast<long>(sender.resent()));
}

}  // namespace
}  // namespace flamefield
