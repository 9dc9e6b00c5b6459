// GET jobs; POST reprocess, reprocess/estimate
#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>

#include "reconstruct/solver.h"
#include "services/api/call.h"
#include "services/api/recipe_json.h"
#include "services/ledger/run_list.h"

namespace flamefield {
namespace {

using Json = nlohmann::ordered_json;
constexpr std::size_t kMostRuns = 10'000;

// What one order to the dispatcher holds: sets that share a rig, a grid and reference captures.
struct Order {
  Submit submit;
  std::vector<double> seconds;  // of earlier runs of these sets with the same solver
};

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

// The sets of the given runs once more, with another recipe; `only_first` keeps one set, for a preview.
Result<std::vector<Order>> orders_of(const Call& call, const nlohmann::json& body) {
  const auto ids = run_ids_in(body);
  if (!ids) return tl::unexpected(ids.error());
  const auto recipe = recipe_from(body);
  if (!recipe) return tl::unexpected(recipe.error());
  if (auto ok = validate_recipe(*recipe); !ok) return tl::unexpected(ok.error());
  auto ledger = call.services.ledger();
  if (!ledger) return tl::unexpected(ledger.error());
  const bool only_first = body.value("only_first", false);
  std::map<std::string, Order> orders;
  for (const std::string& id : *ids) {
    auto run = ledger->run(id);
    if (!run) return tl::unexpected(run.error());
    Processing processing = run->run.processing;
    const Combine combine = run->run.inputs.size() > 1 ? Combine::Mean : Combine::Each;
    // Means of different sets are orders of their own.
    const std::string key =
        concat(processing.rig_id, ' ', processing.dark_capture, ' ', processing.background_capture, ' ',
               processing.flat_capture, ' ', processing.grid.nx, 'x', processing.grid.ny, 'x',
               processing.grid.nz, ' ', processing.grid.spacing_mm.transpose(), ' ',
               processing.grid.origin_mm.transpose(), ' ', combine == Combine::Mean ? id : "");
    Order& order = orders[key];
    // What the camera's pixels mean belongs to the recording, not to the choice of a solver.
    Recipe merged = *recipe;
    for (const auto& [name, value] : processing.recipe.settings) {
      if (name.starts_with("prepare.")) merged.settings.try_emplace(name, value);
    }
    const bool same_solver = processing.recipe.solver == recipe->solver;
    processing.recipe = std::move(merged);
    order.submit.processing = std::move(processing);
    order.submit.combine = combine;
    order.submit.submitter = "page";
    order.submit.priority = only_first ? Priority::Live : Priority::Interactive;
    order.submit.sets.insert(order.submit.sets.end(), run->run.inputs.begin(), run->run.inputs.end());
    if (same_solver) {
      const RunTimings& t = run->run.timings;
      order.seconds.push_back(t.fetch_s + t.prepare_s + t.solve_s + t.write_s);
    }
    if (only_first) break;
  }
  std::vector<Order> out;
  for (auto& [key, order] : orders) {
    auto& sets = order.submit.sets;
    std::ranges::sort(sets);
    sets.erase(std::unique(sets.begin(), sets.end()), sets.end());
    out.push_back(std::move(order));
  }
  return out;
}

HttpResponse submit(const Call& call, const nlohmann::json& body) {
  const auto orders = orders_of(call, body);
  if (!orders) return error_answer(orders.error());
  Json jobs = Json::array(), runs = Json::array();
  std::int64_t identical = 0;
  for (const Order& order : *orders) {
    const auto submitted = call.services.ask_dispatcher<Submitted>(order.submit, std::chrono::seconds(30));
    if (!submitted) return error_answer(submitted.error());
    for (const std::int64_t job : submitted->job_ids) jobs.push_back(job);
    for (const std::string& run : submitted->run_ids) runs.push_back(run);
    identical += submitted->identical;
  }
  return json_answer({{"jobs", std::move(jobs)}, {"runs", std::move(runs)}, {"identical", identical}}, 202);
}

// The median of what the same solver took for these sets; null when it was never run on them.
HttpResponse estimate(const Call& call, const nlohmann::json& body) {
  auto orders = orders_of(call, body);
  if (!orders) return error_answer(orders.error());
  std::size_t volumes = 0;
  std::vector<double> seconds;
  for (const Order& order : *orders) {
    volumes += order.submit.combine == Combine::Mean ? 1 : order.submit.sets.size();
    seconds.insert(seconds.end(), order.seconds.begin(), order.seconds.end());
  }
  const auto status = call.services.ask_dispatcher<Status>(GetStatus{});
  const std::size_t workers = status ? std::max<std::size_t>(status->workers.size(), 1) : 1;
  Json each = nullptr, total = nullptr;
  if (!seconds.empty()) {
    const auto middle = seconds.begin() + static_cast<std::ptrdiff_t>(seconds.size() / 2);
    std::ranges::nth_element(seconds, middle);
    each = *middle;
    total = *middle * static_cast<double>(volumes) / static_cast<double>(workers);
  }
  return json_answer(
      {{"volumes", volumes}, {"workers", workers}, {"seconds_each", each}, {"seconds_in_all", total}});
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
