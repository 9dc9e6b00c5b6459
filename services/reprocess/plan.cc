#include "services/reprocess/plan.h"

#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "proto/codec.h"
#include "proto/version.h"
#include "services/reprocess/sweep.h"

namespace flamefield {

namespace {

constexpr std::size_t kSetsPerOrder = 2000;  // the dispatcher answers others in between

struct Piece {
  std::vector<SetId> inputs;
  Processing base;
};

std::string both(const std::string& a, const std::string& b) {
  return a.empty() ? b : concat("(", a, ") and ", b);
}

// The calibration that now counts for the piece, if one was ever accepted for it.
Result<> take_accepted_rig(LedgerQuery& ledger, Piece& piece) {
  if (piece.inputs.empty()) return {};
  const auto accepted = ledger.rig_for(piece.inputs.front());
  if (!accepted) return tl::unexpected(accepted.error());
  if (*accepted) piece.base.rig_id = **accepted;
  return {};
}

Result<std::vector<Piece>> recorded_work(LedgerQuery& ledger, const ReprocessOrder& order,
                                         std::int64_t now_ns) {
  const auto filter = parse_filter(order.stale ? both(order.where, "stale") : order.where, now_ns);
  if (!filter) return tl::unexpected(filter.error());
  auto rows = ledger.work(*filter, std::numeric_limits<std::int64_t>::max());
  if (!rows) return tl::unexpected(rows.error());
  std::vector<Piece> pieces;
  for (WorkRow& row : *rows) {
    pieces.push_back({std::move(row.run.inputs), std::move(row.run.processing)});
    if (!order.stale) continue;
    if (auto ok = take_accepted_rig(ledger, pieces.back()); !ok) return tl::unexpected(ok.error());
  }
  return pieces;
}

Result<std::vector<Piece>> named_work(LedgerQuery& ledger, const std::vector<std::string>& run_ids) {
  std::vector<Piece> pieces;
  for (const std::string& id : run_ids) {
    auto row = ledger.run(id);
    if (!row) return tl::unexpected(row.error());
    pieces.push_back({std::move(row->run.inputs), std::move(row->run.processing)});
  }
  return pieces;
}

Result<std::vector<Piece>> stored_sets(LedgerQuery& ledger, const ReprocessOrder& order,
                                       std::int64_t now_ns) {
  const auto filter = parse_filter(both(order.where, "kind in (burst, live)"), now_ns, FilterOver::Sets);
  if (!filter) return tl::unexpected(filter.error());
  const auto ids = ledger.sets(*filter);
  if (!ids) return tl::unexpected(ids.error());
  std::vector<Piece> pieces;
  if (ids->empty()) return pieces;
  auto base = ledger.newest_processing();
  if (!base) return tl::unexpected(base.error());
  if (!*base)
    return not_found("nothing to start from", "no set was ever reconstructed here, and no live plan was made",
                     "start 'flamefield serve --rig rig.yaml' once");
  for (const SetId& id : *ids) {
    pieces.push_back({{id}, **base});
    if (auto ok = take_accepted_rig(ledger, pieces.back()); !ok) return tl::unexpected(ok.error());
  }
  return pieces;
}

// The recipe of the order, or the piece's own, with the order's settings and one combination of the sweep.
Result<Recipe> changed_recipe(const Recipe& own, const std::optional<Recipe>& other,
                              const std::vector<std::string>& settings,
                              const std::vector<std::string>& combination, const RecipeCheck& check) {
  Recipe recipe = other.value_or(own);
  if (other) {
    for (const auto& [key, value] : own.settings) {
      if (key.starts_with("prepare.")) recipe.settings.emplace(key, value);
    }
  }
  for (const auto* list : {&settings, &combination}) {
    for (const std::string& setting : *list) {
      if (auto ok = assign(recipe, setting); !ok) return tl::unexpected(ok.error());
    }
  }
  if (auto ok = check(recipe); !ok) return tl::unexpected(ok.error());
  return recipe;
}

// Puts work together that may travel in one message.
class Orders {
 public:
  Orders(LedgerQuery& ledger, ReprocessPlan& plan) : ledger_(ledger), plan_(plan) {}

  Result<> add(const std::vector<SetId>& inputs, const Processing& processing) {
    const std::string key = encode(LivePlan{true, processing});
    std::string identity = key;
    for (const SetId& id : inputs) identity += concat('\n', id.capture, ' ', id.index);
    if (!seen_.insert(identity).second) return {};  // two selected runs that the changes make equal
    ++plan_.asked;
    Job job;
    job.inputs = inputs;
    job.processing = processing;
    job.program_version = program_version();
    const auto there = ledger_.has_work(job);
    if (!there) return tl::unexpected(there.error());
    if (*there) {
      plan_.identical.push_back(run_id_of(job));
      return {};
    }
    if (auto ok = estimate(processing, key); !ok) return ok;
    Submit* open = inputs.size() == 1 ? open_[key] : nullptr;
    if (!open || open->sets.size() >= kSetsPerOrder) {
      orders_.push_back(std::make_unique<Submit>());
      open = orders_.back().get();
      open->processing = processing;
      open->priority = Priority::Scheduled;
      open->combine = inputs.size() == 1 ? Combine::Each : Combine::Mean;
      if (inputs.size() == 1) open_[key] = open;
    }
    open->sets.insert(open->sets.end(), inputs.begin(), inputs.end());
    return {};
  }
  void finish() {
    for (auto& order : orders_) plan_.orders.push_back(std::move(*order));
  }

 private:
  Result<> estimate(const Processing& processing, const std::string& key) {
    auto known = past_.find(key);
    if (known == past_.end()) {
      const auto past = ledger_.past_work(processing.recipe.solver, processing.grid);
      if (!past) return tl::unexpected(past.error());
      known = past_.emplace(key, *past).first;
      plan_.past_runs += past->runs;
    }
    plan_.seconds += known->second.seconds;
    plan_.peak_rss_mib = std::max(plan_.peak_rss_mib, known->second.peak_rss_mib);
    return {};
  }

  LedgerQuery& ledger_;
  ReprocessPlan& plan_;
  std::set<std::string> seen_;
  std::map<std::string, Submit*> open_;
  std::map<std::string, PastWork> past_;
  std::vector<std::unique_ptr<Submit>> orders_;
};

// The order's changes, laid over each piece.
Result<ReprocessPlan> plan_of(LedgerQuery& ledger, const std::vector<Piece>& pieces,
                              const ReprocessOrder& order, const RecipeCheck& check) {
  std::optional<Recipe> other;
  if (!order.recipe.empty()) {
    auto parsed = parse_recipe(order.recipe, "recipe", check);
    if (!parsed) return tl::unexpected(parsed.error());
    other = std::move(*parsed);
  }
  const auto combinations = sweep_combinations(order.sweep);
  if (!combinations) return tl::unexpected(combinations.error());
  ReprocessPlan plan;
  Orders orders(ledger, plan);
  for (const Piece& piece : pieces) {
    if (piece.inputs.empty()) continue;
    Processing processing = piece.base;
    if (!order.rig_id.empty()) processing.rig_id = order.rig_id;
    for (const auto& combination : *combinations) {
      auto recipe = changed_recipe(piece.base.recipe, other, order.settings, combination, check);
      if (!recipe) return tl::unexpected(recipe.error());
      processing.recipe = std::move(*recipe);
      if (auto ok = orders.add(piece.inputs, processing); !ok) return tl::unexpected(ok.error());
    }
  }
  orders.finish();
  return plan;
}

}  // namespace

Result<ReprocessPlan> plan_reprocessing(LedgerQuery& ledger, const ReprocessOrder& order,
                                        const RecipeCheck& check, std::int64_t now_ns) {
  const auto as_typed = parse_filter(order.where, now_ns);  // its faults count characters as they were typed
  if (!as_typed) return tl::unexpected(as_typed.error());
  const auto pieces = as_typed->mentions_runs || order.stale ? recorded_work(ledger, order, now_ns)
                                                             : stored_sets(ledger, order, now_ns);
  if (!pieces) return tl::unexpected(pieces.error());
  return plan_of(ledger, *pieces, order, check);
}

Result<ReprocessPlan> plan_reprocessing(LedgerQuery& ledger, const std::vector<std::string>& run_ids,
                                        const ReprocessOrder& order, const RecipeCheck& check) {
  const auto pieces = named_work(ledger, run_ids);
  if (!pieces) return tl::unexpected(pieces.error());
  return plan_of(ledger, *pieces, order, check);
}

ReprocessPlan preview_of(const ReprocessPlan& plan) {
  ReprocessPlan preview;
  if (plan.orders.empty()) {
    preview.identical.assign(plan.identical.begin(),
                             plan.identical.begin() + (plan.identical.empty() ? 0 : 1));
    preview.asked = static_cast<std::int64_t>(preview.identical.size());
    return preview;
  }
  Submit first = plan.orders.front();
  if (first.combine == Combine::Each) first.sets.resize(1);
  first.priority = Priority::Interactive;
  preview.asked = 1;
  preview.past_runs = plan.past_runs;
  preview.seconds = plan.seconds / static_cast<double>(plan.volumes());
  preview.peak_rss_mib = plan.peak_rss_mib;
  preview.orders.push_back(std::move(first));
  return preview;
}

Result<Submitted> submit_plan(const ReprocessPlan& plan,
                              const std::function<Result<Submitted>(const Submit&)>& ask) {
  Submitted all;
  for (const Submit& order : plan.orders) {
    const auto answer = ask(order);
    if (!answer) return tl::unexpected(answer.error());
    all.job_ids.insert(all.job_ids.end(), answer->job_ids.begin(), answer->job_ids.end());
    all.run_ids.insert(all.run_ids.end(), answer->run_ids.begin(), answer->run_ids.end());
    all.identical += answer->identical;
  }
  all.run_ids.insert(all.run_ids.end(), plan.identical.begin(), plan.identical.end());
  all.identical += static_cast<std::int64_t>(plan.identical.size());
  return all;
}

}  // namespace flamefield
