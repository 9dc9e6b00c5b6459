#pragma once

#include "services/cli/app.h"

namespace CLI {
class App;
}

namespace flamefield {

// The commands of `flamefield bench`.
void add_bench_projector(CLI::App& group, Session& session);
void add_bench_scaling(CLI::App& group, Session& session);
void add_bench_solvers(CLI::App& group, Session& session);
void add_bench_ert(CLI::App& group, Session& session);
void add_bench_pipeline(CLI::App& group, Session& session);
void add_bench_queue(CLI::App& group, Session& session);

}  // namespace flamefield
