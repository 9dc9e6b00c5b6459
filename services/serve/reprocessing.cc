#include "services/serve/reprocessing.h"

#include "proto/utc.h"
#include "reconstruct/solver.h"
#include "services/bus/client.h"
#include "services/reprocess/plan.h"

namespace flamefield {

namespace {

// One question at a time over a connection of its own.
template <class Answer>
Result<Answer> ask(Bus& bus, const std::string& endpoint, const Message& question) {
  auto client = Client::connect(bus, "operator", unique_name("scheduler"), endpoint);
  if (!client) return tl::unexpected(client.error());
  return client->ask_for<Answer>(question, std::chrono::seconds(10));
}

}  // namespace

Scheduler make_scheduler(Bus& bus, const std::string& endpoint, const std::filesystem::path& data_dir) {
  SchedulerDesk desk;
  desk.schedules = [data_dir]() -> Result<std::vector<ScheduleRow>> {
    auto ledger = LedgerQuery::open(data_dir);
    if (!ledger) return tl::unexpected(ledger.error());
    return ledger->schedules();
  };
  desk.launch = [&bus, endpoint, data_dir](const ReprocessOrder& order) -> Result<Submitted> {
    auto ledger = LedgerQuery::open(data_dir);
    if (!ledger) return tl::unexpected(ledger.error());
    const auto plan = plan_reprocessing(*ledger, order, validate_recipe, utc_now_ns());
    if (!plan) return tl::unexpected(plan.error());
    return submit_plan(*plan, [&](const Submit& submit) { return ask<Submitted>(bus, endpoint, submit); });
  };
  desk.record = [&bus, endpoint](const ScheduleRan& happened) -> Result<> {
    const auto accepted = ask<Accepted>(bus, endpoint, happened);
    if (!accepted) return tl::unexpected(accepted.error());
    return {};
  };
  return Scheduler(std::move(desk), system_clock_of_scheduler());
}

}  // namespace flamefield
