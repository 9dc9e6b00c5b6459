#include "services/cli/board_options.h"

#include <CLI/CLI.hpp>

#include "services/cli/app.h"

namespace flamefield {

CLI::Option* add_board_options(CLI::App& command, BoardOptions& options) {
  command.add_option("--board", options.board, "Inner corners of the board")->capture_default_str();
  command.add_option("--board-type", options.type, "checkerboard or charuco")
      ->check(CLI::IsMember({"checkerboard", "charuco"}))
      ->capture_default_str();
  command.add_option("--marker-mm", options.marker_mm, "Side of a marker (charuco)");
  command.add_option("--dictionary", options.dictionary, "ArUco dictionary of the markers (charuco)")
      ->capture_default_str();
  return command.add_option("--square-mm", options.square_mm, "Side of a square");
}

BoardSpec board_of(const BoardOptions& options) {
  BoardSpec board = or_usage(board_from_text(options.board, options.square_mm));
  board.kind = *board_kind_from_name(options.type);
  if (board.kind == BoardKind::Charuco) {
    board.marker_mm = options.marker_mm;
    board.dictionary = options.dictionary;
  }
  or_usage(validate(board));
  return board;
}

}  // namespace flamefield
