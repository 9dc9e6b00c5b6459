// GET runs, runs/ID, runs/ID/volume, runs/ID/thumbnail.png
#include <nlohmann/json.hpp>

#include "services/api/call.h"
#include "services/api/records_json.h"
#include "services/api/volume_messages.h"
#include "services/ledger/run_list.h"
#include "services/store/volume_file.h"

namespace flamefield {
namespace {

using Json = nlohmann::ordered_json;

Result<RunOrder> order_from(const std::string& name) {
  static const std::map<std::string, RunOrder> kOrders = {
      {"", RunOrder::Finished},        {"finished", RunOrder::Finished}, {"capture", RunOrder::Capture},
      {"solver", RunOrder::Solver},    {"residual", RunOrder::Residual}, {"duration", RunOrder::Duration},
      {"volume_bytes", RunOrder::Size}};
  const auto found = kOrders.find(name);
  if (found == kOrders.end())
    return invalid_input("sort=" + name, "runs cannot be sorted by it",
                         "use finished, capture, solver, residual, duration or volume_bytes");
  return found->second;
}

Json json_of(const RunLine& line) {
  return {{"id", line.id},
          {"capture", line.capture},
          {"index", line.first_index},
          {"inputs", line.inputs},
          {"solver", line.solver},
          {"worker", line.worker},
          {"rig", line.rig_id},
          {"iterations", line.iterations},
          {"residual", line.residual},
          {"volume_bytes", line.volume_bytes},
          {"duration_s", 1e-9 * static_cast<double>(line.finished_time_ns - line.started_time_ns)},
          {"finished", utc_text(line.finished_time_ns)}};
}

Result<Json> runs_page(const Call& call) {
  constexpr std::int64_t kMost = 1000, kNoEnd = 1'000'000'000;
  const auto order = order_from(call.query("sort"));
  const auto offset = call.number("offset", 0, 0, kNoEnd), limit = call.number("limit", 100, 0, kMost);
  if (!order) return tl::unexpected(order.error());
  if (!offset) return tl::unexpected(offset.error());
  if (!limit) return tl::unexpected(limit.error());
  Json page = {{"total", 0}, {"offset", *offset}, {"solvers", Json::array()}, {"runs", Json::array()}};
  auto list = RunList::open(call.services.data_dir());
  if (!list) {  // nothing was ever captured
    if (list.error().code == ErrorCode::NotFound) return page;
    return tl::unexpected(list.error());
  }
  const auto found = list->page({.search = call.query("search"),
                                 .capture = call.query("capture"),
                                 .solver = call.query("solver"),
                                 .rig_id = call.query("rig"),
                                 .order = *order,
                                 .is_descending = call.query("order") != "asc",
                                 .offset = *offset,
                                 .limit = *limit});
  if (!found) return tl::unexpected(found.error());
  page["total"] = found->total;
  if (const auto solvers = list->solvers()) page["solvers"] = *solvers;
  for (const RunLine& line : found->lines) page["runs"].push_back(json_of(line));
  return page;
}

Result<RunRow> run_of(const Call& call) {
  auto ledger = call.services.ledger();
  if (!ledger) return tl::unexpected(ledger.error());
  return ledger->run(call.parts[1]);
}

Result<Volume> volume_of(const Call& call, const RunRow& run) {
  return read_volume(call.services.data_dir() / run.run.volume_path);
}

HttpResponse volume_answer(const Call& call, const RunRow& run) {
  const auto side = call.number("max_side", 96, 8, 512), bits = call.number("bits", 8, 8, 16);
  if (!side) return error_answer(side.error());
  if (!bits) return error_answer(bits.error());
  const auto volume = volume_of(call, run);
  if (!volume) return error_answer(volume.error());
  std::int64_t pulse_time_ns = 0;
  if (auto list = RunList::open(call.services.data_dir()); list && !run.run.inputs.empty()) {
    const SetId& first = run.run.inputs.front();
    pulse_time_ns = list->pulse_time_ns(first.capture, first.index).value_or(0);
  }
  auto message = volume_message(*volume, run, pulse_time_ns,
                                {.most_side = static_cast<int>(*side), .bits = static_cast<int>(*bits)});
  if (!message) return error_answer(message.error());
  return binary_answer(std::move(*message), "application/octet-stream", true);
}

HttpResponse thumbnail_answer(const Call& call, const RunRow& run) {
  const auto volume = volume_of(call, run);
  if (!volume) return error_answer(volume.error());
  auto png = thumbnail_png(*volume);
  if (!png) return error_answer(png.error());
  return binary_answer(std::move(*png), "image/png", true);
}

}  // namespace

std::optional<HttpResponse> answer_runs(const Call& call) {
  if (call.request.method != "GET" || call.parts[0] != "runs") return std::nullopt;
  if (call.parts.size() == 1) {
    const auto page = runs_page(call);
    return page ? json_answer(*page) : error_answer(page.error());
  }
  const auto run = run_of(call);
  if (!run) return error_answer(run.error());
  if (call.parts.size() == 2) {
    Json json = json_of(*run);
    json["history"] = json_of(run->run.history);
    return json_answer(json);
  }
  if (call.parts.size() == 3 && call.parts[2] == "volume") return volume_answer(call, *run);
  if (call.parts.size() == 3 && call.parts[2] == "thumbnail.png") return thumbnail_answer(call, *run);
  return std::nullopt;
}

}  // namespace flamefield
