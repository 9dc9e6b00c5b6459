#include <csignal>

#include "services/cli/on_ranks.h"
#include "services/mpi/mpi_ranks.h"

int main(int argc, char** argv) {
  // Before MPI starts threads of its own: they would die of what asks the work to stop (SignalStop).
  sigset_t stops;
  sigemptyset(&stops);
  sigaddset(&stops, SIGINT);
  sigaddset(&stops, SIGTERM);
  ::pthread_sigmask(SIG_BLOCK, &stops, nullptr);
  flamefield::MpiRanks ranks(&argc, &argv);
  return flamefield::run_command_line_on(ranks, argc, argv);
}
