#include <CLI/CLI.hpp>

#include "services/cli/bench_commands.h"
#include "services/cli/commands.h"

namespace flamefield {

void add_bench(CLI::App& app, Session& session) {
  auto* group =
      app.add_subcommand("bench", "Measure this machine: projector, solvers, scaling, pipeline, queue");
  group->require_subcommand(1);
  group->footer(
      "Examples:\n  flamefield bench projector --case A\n  flamefield bench solvers --solver mlem,sirt");
  for (const auto& add : {&add_bench_projector, &add_bench_scaling, &add_bench_solvers, &add_bench_ert,
                          &add_bench_pipeline, &add_bench_queue})
    add(*group, session);
}

}  // namespace flamefield
