#include "services/cli/app.h"

int main(int argc, char** argv) {
  return flamefield::run_command_line(argc, argv);
}
