#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>

#include "proto/utc.h"
#include "services/api/records_json.h"
#include "services/cli/commands.h"
#include "services/cli/connection.h"
#include "services/ledger/query.h"
#include "services/store/rig_file.h"

namespace flamefield {

namespace {

using Json = nlohmann::ordered_json;

struct Options {
  DataOption data;
  std::filesystem::path rig;
  std::string since;
  bool json = false;
};

std::string rms_text(double rms_px) {
  return rms_px == rms_px ? fmt::format("{:.3f}", rms_px) : "-";
}

void list(const Options& options) {
  const auto rows = or_fail(or_fail(LedgerQuery::open(options.data.dir)).accepted_rigs());
  if (options.json) {
    Json all = Json::array();
    for (const AcceptedRigRow& row : rows)
      all.push_back({{"rig", row.rig_id},
                     {"accepted", utc_text(row.accepted_time_ns)},
                     {"since", utc_text(row.since_ns)},
                     {"rms_px", row.rms_px == row.rms_px ? Json(row.rms_px) : Json(nullptr)}});
    std::cout << all.dump(2) << '\n';
    return;
  }
  std::cout << fmt::format("{:<18} {:<25} {:<25} {:>7}\n", "RIG", "ACCEPTED (UTC)", "FOR PULSES SINCE",
                           "RMS px");
  for (const AcceptedRigRow& row : rows)
    std::cout << fmt::format("{:<18} {:<25} {:<25} {:>7}\n", row.rig_id, utc_text(row.accepted_time_ns),
                             row.since_ns == 0 ? "the beginning" : utc_text(row.since_ns),
                             rms_text(row.rms_px));
  if (rows.empty()) std::cout << "no calibration was accepted yet: 'flamefield rigs accept rig.yaml'\n";
}

// By default a calibration counts for what was taken since the one before was accepted: any time in between
// the cameras may have moved.
std::int64_t since_ns(const Options& options, LedgerQuery& ledger) {
  if (options.since == "all") return 0;
  if (!options.since.empty()) {
    const auto time = or_usage(parse_filter(concat("time >= '", options.since, "'"), utc_now_ns()));
    return std::get<std::int64_t>(time.values.at(0));
  }
  const auto accepted = or_fail(ledger.accepted_rigs());
  return accepted.empty() ? 0 : accepted.front().accepted_time_ns;
}

void accept(const Options& options) {
  const Rig rig = or_usage(read_rig(options.rig));
  auto ledger = or_fail(LedgerQuery::open(options.data.dir));
  const AcceptRig accepted{fingerprint(rig), since_ns(options, ledger)};
  DispatcherConnection connection = connect_to_dispatcher(options.data);
  or_fail(connection.client.ask_for<RigStored>(PutRig{rig}, std::chrono::seconds(10)));
  or_fail(connection.client.ask_for<Accepted>(accepted, std::chrono::seconds(10)));
  const std::int64_t stale = or_fail(ledger.count_work(or_fail(parse_filter("stale", utc_now_ns()))));
  if (options.json) {
    std::cout
        << Json{{"rig", accepted.rig_id}, {"since", utc_text(accepted.since_ns)}, {"stale", stale}}.dump(2)
        << '\n';
    return;
  }
  std::cout << accepted.rig_id << " counts for everything since "
            << (accepted.since_ns == 0 ? "the beginning" : utc_text(accepted.since_ns)) << "\n";
  if (stale > 0)
    std::cout << stale << " volumes were made with another calibration. To redo them:\n"
              << "  flamefield reprocess --stale --data " << options.data.dir.string() << '\n';
}

}  // namespace

void add_rigs(CLI::App& app, Session& session) {
  auto* rigs = app.add_subcommand("rigs", "Which calibration counts, and for what");
  rigs->require_subcommand(1);
  auto options = std::make_shared<Options>();
  auto* listing = rigs->add_subcommand("list", "Accepted calibrations, the newest first");
  add_data(*listing, options->data);
  listing->add_flag("--json", options->json, "Print as JSON");
  listing->footer("Example:\n  flamefield rigs list");
  listing->callback([=, &session] { session.choose([=] { list(*options); }); });

  options = std::make_shared<Options>();
  auto* accepting =
      rigs->add_subcommand("accept", "From now on this calibration counts; older volumes become stale");
  add_data(*accepting, options->data);
  accepting->add_option("RIG", options->rig, "rig.yaml of 'flamefield calibrate solve'")->required();
  accepting->add_option(
      "--since", options->since,
      "For pulses from this time on: 2026-03-01T10:15 (UTC), -2h, or all; by default since the "
      "last calibration was accepted");
  accepting->add_flag("--json", options->json, "Print the result as JSON");
  accepting->footer("Example:\n  flamefield rigs accept rig.yaml --since -2h");
  accepting->callback([=, &session] { session.choose([=] { accept(*options); }); });
}

}  // namespace flamefield
