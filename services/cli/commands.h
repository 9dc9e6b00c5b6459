#pragma once

#include "services/cli/app.h"

namespace CLI {
class App;
}

namespace flamefield {

// Each adds one command to the program, in a file of its own: options, help with an example, and work.
void add_phantom(CLI::App& app, Session& session);
void add_ring(CLI::App& app, Session& session);
void add_render(CLI::App& app, Session& session);
void add_prepare(CLI::App& app, Session& session);
void add_reconstruct(CLI::App& app, Session& session);
void add_evaluate(CLI::App& app, Session& session);
void add_bench(CLI::App& app, Session& session);  // projector, solvers ...
void add_study(CLI::App& app, Session& session);
void add_show(CLI::App& app, Session& session);
void add_convert(CLI::App& app, Session& session);
void add_calibrate(CLI::App& app, Session& session);
void add_calibrate_session(CLI::App& calibrate, Session& session);  // below calibrate
void add_calibrate_history(CLI::App& calibrate, Session& session);
void add_demo(CLI::App& app, Session& session);
void add_serve(CLI::App& app, Session& session);
void add_simulate(CLI::App& app, Session& session);
void add_capture(CLI::App& app, Session& session);  // and stop
void add_runs(CLI::App& app, Session& session);
void add_cameras(CLI::App& app, Session& session);  // list, test
void add_export(CLI::App& runs, Session& session);  // below runs
void add_replay(CLI::App& app, Session& session);
void add_doctor(CLI::App& app, Session& session);
void add_status(CLI::App& app, Session& session);
void add_jobs(CLI::App& app, Session& session);  // list, pause, resume, cancel, retry
void add_selftest(CLI::App& app, Session& session);
void add_reprocess(CLI::App& app, Session& session);
void add_schedule(CLI::App& app, Session& session);  // list, add, remove, run-now
void add_rigs(CLI::App& app, Session& session);      // list, accept
void add_keys(CLI::App& app, Session& session);      // make, list, allow, revoke
void add_ledger(CLI::App& app, Session& session);    // check, backup, retain
void add_cluster(CLI::App& app, Session& session);   // up, status, down

}  // namespace flamefield
