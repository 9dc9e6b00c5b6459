// GET jobs; POST reprocess, reprocess/estimate
#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>

#include "reconstruct/solver.h"
#include "services/api/call.h"
#include "services/api/recipe_json.h"
#include "services/config/recipe_file.h"
#include "services/ledger/query.h"
#include "services/ledger/run_list.h"
#include "services/reprocess/plan.h"

namespace flamefield {
namespace {

using Json = nlohmann::ordered_json;
constexpr std::size_t kMostRuns = 10'000;

Result<std::vector<std::string>> run_ids_in(const nlohmann::json& body) {
  std::vector<std::string> ids;
  if (body.contains("runs") && body["runs"].is_array()) {
    for (const auto& id : body["runs"]) {
      if (id.is_string()) ids.push_back(id.get<std::string>());
    }
  }
  if (ids.empty() || ids.size() > kMostRuns)
    return invalid_input("runs", concat("1 to ", kMostRuns, " ids are wanted"), "tick runs in the table");
  return ids;
}

// The given runs once more with another recipe; `only_first` keeps one volume, ahead of everything else.
Result<ReprocessPlan> plan_in(const Call& call, const nlohmann::json& body) {
  const auto ids = run_ids_in(body);
  if (!ids) return tl::unexpected(ids.error());
  const auto recipe = recipe_from(body);
  if (!recipe) return tl::unexpected(recipe.error());
  auto ledger = LedgerQuery::open(call.services.data_dir());
  if (!ledger) return tl::unexpected(ledger.error());
  ReprocessOrder order;
  order.recipe = toml_of(*recipe);
  auto plan = plan_reprocessing(*ledger, *ids, order, validate_recipe);
  if (!plan) return plan;
  const bool only_first = body.value("only_first", false);
  if (only_first) *plan = preview_of(*plan);
  for (Submit& submit : plan->orders) {
    submit.submitter = "page";
    submit.priority = only_first ? Priority::Live : Priority::Interactive;
  }
  return plan;
}

HttpResponse submit(const Call& call, const nlohmann::json& body) {
  const auto plan = plan_in(call, body);
  if (!plan) return error_answer(plan.error());
  const auto submitted = submit_plan(*plan, [&](const Submit& order) {
    return call.services.ask_dispatcher<Submitted>(order, std::chrono::seconds(30));
  });
  if (!submitted) return error_answer(submitted.error());
  return json_answer(
      {{"jobs", submitted->job_ids}, {"runs", submitted->run_ids}, {"identical", submitted->identical}}, 202);
}

// From what the same solver took before; null when it was never run.
HttpResponse estimate(const Call& call, const nlohmann::json& body) {
  const auto plan = plan_in(call, body);
  if (!plan) return error_answer(plan.error());
  const auto status = call.services.ask_dispatcher<Status>(GetStatus{});
  const std::size_t workers = status ? std::max<std::size_t>(status->workers.size(), 1) : 1;
  const std::int64_t volumes = plan->volumes();
  Json each = nullptr, total = nullptr, memory = nullptr;
  if (plan->past_runs > 0 && volumes > 0) {
    each = plan->seconds / static_cast<double>(volumes);
    total = plan->seconds / static_cast<double>(workers);
    memory = plan->peak_rss_mib;
  }
  return json_answer({{"volumes", volumes},
                      {"identical", plan->identical.size()},
                      {"workers", workers},
                      {"seconds_each", each},
                      {"seconds_in_all", total},
                      {"peak_rss_mib", memory}});
}

HttpResponse jobs(const Call& call) {
  constexpr std::int64_t kLast = std::numeric_limits<std::int64_t>::max();
  const auto first = call.number("first", 0, 0, kLast), last = call.number("last", kLast, 0, kLast),
             limit = call.number("limit", 100, 0, 1000);
  if (!first) return error_answer(first.error());
  if (!last) return error_answer(last.error());
  if (!limit) return error_answer(limit.error());
  auto list = RunList::open(call.services.data_dir());
  if (!list) return error_answer(list.error());
  const auto page = list->jobs(*first, *last, *limit);
  if (!page) return error_answer(page.error());
  Json rows = Json::array();
  for (const JobPage::Line& job : page->lines)
    rows.push_back({{"job", job.id},
                    {"run", job.run_id},
                    {"state", job.state},
                    {"attempt", job.attempt},
                    {"worker", job.worker},
                    {"reason", job.reason}});
  return json_answer({{"queued", page->queued},
                      {"leased", page->leased},
                      {"done", page->done},
                      {"failed", page->failed},
                      {"jobs", std::move(rows)}});
}

}  // namespace

std::optional<HttpResponse> answer_work(const Call& call) {
  const auto& parts = call.parts;
  if (call.request.method == "GET" && parts.size() == 1 && parts[0] == "jobs") return jobs(call);
  if (call.request.method != "POST" || parts[0] != "reprocess" || parts.size() > 2) return std::nullopt;
  const auto body = call.body();
  if (!body) return error_answer(body.error());
  if (parts.size() == 1) return submit(call, *body);
  return parts[1] == "estimate" ? std::optional(estimate(call, *body)) : std::nullopt;
}

}  // namespace flamefield
