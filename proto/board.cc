#include "proto/board.h"

#include <Eigen/Geometry>
#include <charconv>
#include <cmath>

namespace flamefield {

std::string_view name_of(BoardKind kind) {
  return kind == BoardKind::Charuco ? "charuco" : "checkerboard";
}

std::optional<BoardKind> board_kind_from_name(std::string_view name) {
  for (BoardKind kind : {BoardKind::Checkerboard, BoardKind::Charuco})
    if (name == name_of(kind)) return kind;
  return std::nullopt;
}

Result<> validate(const BoardSpec& board) {
  if (board.cols < 3 || board.rows < 3 || board.cols > 100 || board.rows > 100) {
    return invalid_input(concat("board of ", board.cols, "x", board.rows, " inner corners"),
                         "3 to 100 a side are supported", "count the inner corners, e.g. --board 9x6");
  }
  if (!(board.square_mm > 0) || !std::isfinite(board.square_mm)) {
    return invalid_input(concat("board squares of ", board.square_mm, " mm"), "must be positive",
                         "measure one square, e.g. --square-mm 12");
  }
  if (board.kind == BoardKind::Checkerboard) return {};
  if (!(board.marker_mm >= 0.3 * board.square_mm && board.marker_mm <= 0.9 * board.square_mm)) {
    return invalid_input(concat("markers of ", board.marker_mm, " mm in squares of ", board.square_mm, " mm"),
                         "0.3 to 0.9 of the square are supported", "measure one, e.g. --marker-mm 8");
  }
  if (board.dictionary.empty()) {
    return invalid_input("the markers' dictionary is not named", "numbers of markers depend on it",
                         "see what was printed, e.g. --dictionary 4X4_50");
  }
  return {};
}

Result<BoardSpec> board_from_text(std::string_view cols_x_rows, double square_mm) {
  BoardSpec board;
  board.cols = board.rows = 0;
  board.square_mm = square_mm;
  const char* const end = cols_x_rows.data() + cols_x_rows.size();
  const auto cols = std::from_chars(cols_x_rows.data(), end, board.cols);
  bool good = cols.ec == std::errc() && cols.ptr != end && *cols.ptr == 'x';
  if (good) {
    const auto rows = std::from_chars(cols.ptr + 1, end, board.rows);
    good = rows.ec == std::errc() && rows.ptr == end;
  }
  if (!good) {
    return invalid_input(concat("board '", cols_x_rows, "'"), "expected COLSxROWS of inner corners",
                         "e.g. --board 9x6");
  }
  if (auto ok = validate(board); !ok) return tl::unexpected(ok.error());
  return board;
}

std::vector<Eigen::Vector3d> corners_mm(const BoardSpec& board) {
  std::vector<Eigen::Vector3d> points;
  points.reserve(board.corners());
  for (int row = 0; row < board.rows; ++row) {
    for (int col = 0; col < board.cols; ++col) {
      points.emplace_back((col - 0.5 * (board.cols - 1)) * board.square_mm,
                          (row - 0.5 * (board.rows - 1)) * board.square_mm, 0);
    }
  }
  return points;
}

std::vector<Eigen::Vector3d> marker_centres_mm(const BoardSpec& board) {
  std::vector<Eigen::Vector3d> centres;
  for (int row = 0; row <= board.rows; ++row) {
    for (int col = 0; col <= board.cols; ++col) {
      if ((row + col) % 2 == 0) continue;  // dark
      centres.emplace_back((col - 0.5 * board.cols) * board.square_mm,
                           (row - 0.5 * board.rows) * board.square_mm, 0);
    }
  }
  return centres;
}

Rigid3 upright_board(const Eigen::Vector3d& centre_mm, double azimuth_rad) {
  const Eigen::Vector3d z(-std::cos(azimuth_rad), 0, -std::sin(azimuth_rad)), y(0, -1, 0);
  Rigid3 world_from_board;
  world_from_board.rotation << y.cross(z), y, z;
  world_from_board.translation_mm = centre_mm;
  return world_from_board;
}

}  // namespace flamefield
