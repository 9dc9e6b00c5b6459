// A worker whose step dies of set 3, as a defect in a solver would make it. usage: DATA ENDPOINT
#include <csignal>
#include <fstream>

#include "services/bus/client.h"
#include "services/bus/keys.h"
#include "services/process/signals.h"
#include "services/process/supervisor.h"
#include "services/worker/worker.h"

int main(int argc, char** argv) {
  using namespace flamefield;
  if (argc != 3) return 2;
  const std::filesystem::path data = argv[1];
  const std::string name = unique_name("worker");
  return supervise([&](Life& life) {
    const SignalStop stop;
    Bus bus(KeyRing::open(data / "keys", "worker").value());
    WorkerOptions options{.endpoint = argv[2], .name = name, .data_dir = data};
    options.heartbeat = std::chrono::milliseconds(100);
    Worker worker(bus, options, [&](const JobContext& context) -> Result<Run> {
      const Job& job = context.lease.job;
      std::ofstream(data / "attempts", std::ios::app) << job.inputs[0].index << ' ' << name << '\n';
      if (job.inputs[0].index == 3) {
        std::signal(SIGSEGV, SIG_DFL);  // a sanitizer's handler would turn it into an ordinary exit
        std::raise(SIGSEGV);
      }
      Run run;
      run.id = job.run_id;
      run.job_id = job.id;
      run.inputs = job.inputs;
      run.processing = job.processing;
      run.worker = context.worker;
      run.volume_path = "volumes/" + run.id + ".vtkhdf";
      std::ofstream(data / staged_path(run.volume_path, context.lease.token)) << "volume";
      return run;
    });
    worker.watched_by(life.in_hand, {life.lost, life.death});
    return worker.run(stop.token()) ? 0 : 1;
  });
}
