#pragma once

#include "reconstruct/ranks.h"

namespace CLI {
class App;
}

namespace flamefield {

class Session;

// The program of processes that work together (flamefield-mpi), with the commands that can. What all of them
// have to say is said by the first.
int run_command_line_on(Ranks& ranks, int argc, char** argv);

void add_reconstruct_on(Ranks& ranks, CLI::App& app, Session& session);

}  // namespace flamefield
