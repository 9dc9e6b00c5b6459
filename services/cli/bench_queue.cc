// bench queue: what the dispatcher adds to each of many jobs, and how fast a large ledger answers.
#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>

#include "services/bench/queue_bench.h"
#include "services/cli/bench_commands.h"
#include "services/cli/bench_output.h"
#include "services/log/log.h"

namespace flamefield {

namespace {

struct Options {
  QueueOptions queue;
  std::filesystem::path folder;
  bool json = false;
};

nlohmann::ordered_json json_of(const QueueOptions& o, const QueueMeasurement& m) {
  return {{"jobs", o.jobs},
          {"workers", o.workers},
          {"submit_s", m.submit_s},
          {"restart_s", m.restart_s},
          {"done_s", m.done_s},
          {"job_wall_ms", m.job_wall_ms},
          {"job_cpu_ms", m.job_cpu_ms},
          {"runs", o.runs},
          {"ask_ms", m.ask_ms}};
}

void print(const QueueOptions& o, const QueueMeasurement& m) {
  std::cout << o.jobs << " jobs: submitted in " << short_number(m.submit_s)
            << " s, queue read at a restart in " << short_number(m.restart_s) << " s\n"
            << "each job, " << o.workers << " workers that do nothing: " << short_number(m.job_wall_ms)
            << " ms, of which the dispatcher computes " << short_number(m.job_cpu_ms) << " ms\n";
  if (o.runs == 0) return;
  std::cout << "\nledger of " << o.runs << " runs\n";
  TextTable table({"question", "slowest of five (ms)"});
  for (const auto& [what, ms] : m.ask_ms) table.add({what, short_number(ms)});
  std::cout << table.text();
}

void run(Options options, const Session& session) {
  const BenchFolder folder(options.folder);
  options.queue.data_dir = folder.path();
  set_log_level(LogLevel::Error);
  BenchProgress progress("bench queue", session);
  const auto m = or_fail(
      measure_queue(options.queue, session.stop(), [&](const std::string& stage) { progress(stage); }));
  if (options.json)
    std::cout << json_of(options.queue, m).dump(2) << '\n';
  else
    print(options.queue, m);
}

}  // namespace

void add_bench_queue(CLI::App& group, Session& session) {
  auto options = std::make_shared<Options>();
  options->folder = std::filesystem::temp_directory_path();
  QueueOptions& o = options->queue;
  auto* command = group.add_subcommand("queue", "Many jobs through the dispatcher, many runs in the ledger");
  command->add_option("--jobs", o.jobs, "Of one order")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  command->add_option("--runs", o.runs, "In the ledger; 0: leave this part out")
      ->check(CLI::Range(0, 10'000'000))
      ->capture_default_str();
  command->add_option("--workers", o.workers, "That do nothing")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  command->add_option("--folder", options->folder, "On the disk to measure")->capture_default_str();
  command->add_flag("--json", options->json, "Print the figures as JSON");
  command->footer("Example:\n  flamefield bench queue --jobs 10000 --runs 100000");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
