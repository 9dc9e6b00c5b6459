// Stands for flamefield-worker in a pilot: takes its options. FLAMEFIELD_TEST_VERSION: says to be of that
// version. While DATA/hang exists, a job that is started goes on until it is stopped.
#include <CLI/CLI.hpp>
#include <cstdlib>
#include <fstream>
#include <thread>

#include "services/bus/keys.h"
#include "services/process/signals.h"
#include "services/worker/worker.h"

namespace flamefield {

std::string_view program_version() {  // in place of the library's
  const char* other = std::getenv("FLAMEFIELD_TEST_VERSION");
  return other ? other : FLAMEFIELD_VERSION;
}

namespace {

Result<Run> step(const std::filesystem::path& data, const JobContext& context) {
  std::ofstream(data / "started", std::ios::app) << context.worker << '\n';
  if (std::filesystem::exists(data / "hang")) {
    while (!context.stop.stop_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    return unavailable("job", "it was stopped", "it will be done again");
  }
  const Job& job = context.lease.job;
  Run run;
  run.id = job.run_id;
  run.job_id = job.id;
  run.inputs = job.inputs;
  run.processing = job.processing;
  run.worker = context.worker;
  run.volume_path = "volumes/" + run.id + ".vtkhdf";
  std::ofstream(data / staged_path(run.volume_path, context.lease.token)) << "volume";
  return run;
}

}  // namespace
}  // namespace flamefield

int main(int argc, char** argv) {
  using namespace flamefield;
  CLI::App app;
  app.allow_extras();
  WorkerOptions options;
  std::filesystem::path keys;
  std::int64_t idle_s = 0, silence_s = 0;
  app.add_option("--data", options.data_dir);
  app.add_option("--endpoint", options.endpoint);
  app.add_option("--keys", keys);
  app.add_option("--name", options.name);
  app.add_option("--idle-s", idle_s);
  app.add_option("--silence-s", silence_s);
  CLI11_PARSE(app, argc, argv);
  options.idle_limit = std::chrono::seconds(idle_s);
  options.silence_limit = std::chrono::seconds(silence_s);
  const SignalStop stop(true);
  const auto ring = KeyRing::open(keys, "worker");
  if (!ring) return 2;
  Bus bus(*ring);
  Worker worker(bus, options, [&](const JobContext& context) { return step(options.data_dir, context); });
  const auto end = worker.run(stop.token(), stop.drain());
  if (end) return 0;
  std::cerr << end.error().message << '\n';
  return end.error().code == ErrorCode::InvalidInput ? 2 : 1;
}
