#pragma once

#include <string>

#include "proto/board.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace flamefield {

// --board, --square-mm, --board-type, --marker-mm and --dictionary.
struct BoardOptions {
  std::string board = "9x6", type = "checkerboard", dictionary = "4X4_50";
  double square_mm = 0, marker_mm = 0;
};
// Returns the option --square-mm, which says whether a board was described at all.
CLI::Option* add_board_options(CLI::App& command, BoardOptions& options);
// Ends the command when there is no such board.
BoardSpec board_of(const BoardOptions& options);

}  // namespace flamefield
