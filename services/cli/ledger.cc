#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>

#include "proto/utc.h"
#include "services/cli/commands.h"
#include "services/cli/connection.h"
#include "services/cli/progress.h"
#include "services/ledger/books.h"
#include "services/upkeep/check.h"
#include "services/upkeep/retention.h"

namespace flamefield {

namespace {

using Json = nlohmann::ordered_json;
constexpr std::size_t kRunsPerMessage = 1000;

struct Options {
  DataOption data;
  std::filesystem::path file;
  std::string where;
  bool quick = false, dry_run = false, json = false;
};

void check(const Options& options, const Session& session) {
  LedgerCheck found;
  {
    ProgressBar bar("check");
    found = or_fail(check_ledger(
        options.data.dir, {.reads_spool = !options.quick, .reads_artefacts = !options.quick},
        [&](std::int64_t done, std::int64_t total) {
          bar.update(static_cast<double>(done), static_cast<double>(total));
        },
        session.stop()));
  }
  session.check_stop();
  if (options.json) {
    Json faults = Json::array();
    for (const LedgerFault& fault : found.faults)
      faults.push_back(
          {{"kind", fault.kind}, {"subject", fault.subject}, {"text", fault.text}, {"loss", fault.is_loss}});
    std::cout << Json{{"sound", found.is_sound()},
                      {"sets", found.sets},
                      {"artefacts", found.artefacts},
                      {"retired", found.retired},
                      {"without_checksum", found.without_checksum},
                      {"faults", std::move(faults)}}
                     .dump(2)
              << '\n';
  } else {
    for (const LedgerFault& fault : found.faults)
      std::cout << (fault.is_loss ? "LOSS   " : "untidy ") << fault.kind << ' ' << fault.subject << ": "
                << fault.text << '\n';
    std::cout << found.sets << " sets and " << found.artefacts << " files looked at, " << found.retired
              << " retired, " << found.without_checksum << " without a checksum\n";
  }
  if (!found.is_sound())
    throw CommandFailure{ExitCode::Failed,
                         "the ledger and its files do not agree (see above) restore them from a "
                         "backup, or redo volumes with 'flamefield reprocess'"};
}

void backup(const Options& options, const Session&) {
  auto books = or_fail(Books::open(options.data.dir));
  ProgressBar bar("backup");
  or_fail(books.backup(options.file, [&](std::int64_t done, std::int64_t total) {
    bar.update(static_cast<double>(done), static_cast<double>(total));
  }));
  std::cout << options.file.string() << ": " << std::filesystem::file_size(options.file)
            << " bytes, checked. Sets and volumes are files of their own: copy spool/ and volumes/ too\n";
}

void print(const RetentionPlan& plan, const Options& options) {
  if (options.json) {
    Json kept = Json::array();
    for (const auto& entry : plan.kept) kept.push_back({{"run", entry.run_id}, {"why", entry.why}});
    std::cout << Json{{"runs", plan.run_ids},
                      {"bytes", plan.bytes},
                      {"kept", std::move(kept)},
                      {"dry_run", options.dry_run}}
                     .dump(2)
              << '\n';
    return;
  }
  for (const auto& entry : plan.kept) std::cout << "kept " << entry.run_id << ": " << entry.why << '\n';
  std::cout << plan.run_ids.size() << " runs' files " << (options.dry_run ? "would go" : "are gone") << ", "
            << fmt::format("{:.1f} MiB", static_cast<double>(plan.bytes) / 1048576) << "; "
            << plan.kept.size() << " selected runs stay\n";
}

void retain(const Options& options, const Session& session) {
  const auto filter = or_usage(parse_filter(options.where, utc_now_ns()));
  const RetentionPlan plan = or_fail(plan_retention(options.data.dir, filter));
  session.check_stop();
  if (!options.dry_run && !plan.run_ids.empty()) {
    DispatcherConnection connection = connect_to_dispatcher(options.data);
    for (std::size_t i = 0; i < plan.run_ids.size(); i += kRunsPerMessage) {
      const auto first = plan.run_ids.begin() + static_cast<std::ptrdiff_t>(i);
      const auto last =
          first + static_cast<std::ptrdiff_t>(std::min(kRunsPerMessage, plan.run_ids.size() - i));
      or_fail(connection.client.ask_for<Accepted>(Retire{{first, last}}, std::chrono::seconds(60)));
    }
  }
  print(plan, options);
}

CLI::App* sub(CLI::App& parent, Session& session, const char* name, const char* help, const char* example,
              const std::shared_ptr<Options>& options, void (*work)(const Options&, const Session&)) {
  auto* command = parent.add_subcommand(name, help);
  add_data(*command, options->data);
  command->footer(concat("Example:\n  flamefield ledger ", example));
  command->callback([=, &session] { session.choose([=, &session] { work(*options, session); }); });
  return command;
}

}  // namespace

void add_ledger(CLI::App& app, Session& session) {
  auto* ledger = app.add_subcommand("ledger", "Keeps the books in order: check, backup, retention");
  ledger->require_subcommand(1);
  auto options = std::make_shared<Options>();
  auto* checking = sub(*ledger, session, "check", "Ledger, stored sets and volumes against their checksums",
                       "check", options, &check);
  checking->add_flag("--quick", options->quick, "Do not read sets and volumes");
  checking->add_flag("--json", options->json, "Print the result as JSON");

  options = std::make_shared<Options>();
  sub(*ledger, session, "backup", "A copy of the ledger, while the service goes on",
      "backup /backup/ledger-2026-03-01.sqlite", options, &backup)
      ->add_option("FILE", options->file, "The copy")
      ->required();

  options = std::make_shared<Options>();
  auto* retaining =
      sub(*ledger, session, "retain", "Removes volumes that can be made again; their records stay",
          "retain --where 'finished < -90d and not tag = keep' --dry-run", options, &retain);
  retaining->add_option("--where", options->where, "Which runs' files may go; see 'flamefield runs fields'")
      ->required();
  retaining->add_flag("--dry-run", options->dry_run, "Only say what would go");
  retaining->add_flag("--json", options->json, "Print the result as JSON");
}

}  // namespace flamefield
