#include <CLI/CLI.hpp>
#include <iostream>

#include "proto/utc.h"
#include "services/cli/connection.h"
#include "services/cli/runs_commands.h"

namespace flamefield {

std::vector<WorkRow> RunSelection::read(const std::filesystem::path& data_dir) const {
  const std::int64_t now_ns = utc_now_ns();
  (void)or_usage(parse_filter(where, now_ns));  // its faults count characters as they were typed
  std::string text = where.empty() ? where : concat("(", where, ")");
  for (const auto& [field, value] :
       {std::pair("capture", &capture), std::pair("solver", &solver), std::pair("rig", &rig)}) {
    if (!value->empty()) text += concat(text.empty() ? "" : " and ", field, " = \"", *value, "\"");
  }
  auto ledger = or_fail(LedgerQuery::open(data_dir));
  return or_fail(ledger.work(or_usage(parse_filter(text, now_ns)), limit));
}

void add_selection(CLI::App& command, RunSelection& selection) {
  command.add_option("--where", selection.where,
                     "Filter, e.g. 'residual > 0.1 and time > -7d'; see 'flamefield runs fields'");
  command.add_option("--capture", selection.capture, "Only runs of this capture");
  command.add_option("--solver", selection.solver, "Only runs of this solver");
  command.add_option("--rig", selection.rig, "Only runs with this rig");
  command.add_option("--limit", selection.limit, "At most so many, the newest")->capture_default_str();
}

namespace {

struct Tags {
  DataOption data;
  PutTags tags;
};

}  // namespace

void add_tag(CLI::App& runs, Session& session) {
  auto options = std::make_shared<Tags>();
  auto* command =
      runs.add_subcommand("tag", "Mark a run or a capture, to find it again with --where 'tag = ...'");
  add_data(*command, options->data);
  command->add_option("ID", options->tags.subject, "A run or a capture")->required();
  command->add_option("--add", options->tags.add, "As often as needed")->allow_extra_args(false);
  command->add_option("--remove", options->tags.remove, "As often as needed")->allow_extra_args(false);
  command->footer("Example:\n  flamefield runs tag 20260301T101500000-burst --add lean-limit");
  command->callback([options, &session] {
    session.choose([=] {
      DispatcherConnection connection = connect_to_dispatcher(options->data);
      or_fail(connection.client.ask_for<Accepted>(options->tags, std::chrono::seconds(10)));
    });
  });
  auto* fields = runs.add_subcommand("fields", "What --where knows");
  fields->callback([&session] {
    session.choose([] {
      std::cout
          << "filter    = condition, joined by and, or, not, ( )\n"
             "condition = FIELD = VALUE; also != < <= > >= in (A, B), and ~ !~ with * and ? as wildcards\n"
             "time      = 2026-03-01, 2026-03-01T10:15 (UTC), now, -2h, -30d\n"
             "text with blanks or signs stands between quotation marks\n\n"
          << filter_help();
    });
  });
}

}  // namespace flamefield
