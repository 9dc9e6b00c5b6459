#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/error.h"
#include "proto/rigid3.h"

namespace flamefield {

// A checkerboard, named by its inner corners: 9x6 has 10 x 7 squares.
//
// Board frame: origin in the middle of the inner corners, x along the columns (to the right for someone who
// looks at the upright face), y along the rows (down), z into the board, so the face is seen from -z. Corner
// (row 0, column 0) is the top left one, and the square between corners (0, 0) and (1, 1) is dark.
//
// A ChArUco board has a marker of ArUco in each of its white squares, numbered row by row from the top, so
// that it tells its corners apart where only a part of it is seen.
enum class BoardKind { Checkerboard, Charuco };
std::string_view name_of(BoardKind kind);
std::optional<BoardKind> board_kind_from_name(std::string_view name);

struct BoardSpec {
  int cols = 9;
  int rows = 6;
  double square_mm = 12;
  BoardKind kind = BoardKind::Checkerboard;
  double marker_mm = 0;         // side of a marker with its black border; ChArUco only
  std::string dictionary = {};  // of the markers as ArUco names it, e.g. 4X4_50; ChArUco only

  std::size_t corners() const { return static_cast<std::size_t>(cols) * static_cast<std::size_t>(rows); }
  bool operator==(const BoardSpec&) const = default;
};

// Between 3 and 100 corners a side, squares positive and finite, markers well within their squares.
Result<> validate(const BoardSpec& board);

// "9x6" -> columns and rows.
Result<BoardSpec> board_from_text(std::string_view cols_x_rows, double square_mm);

// The inner corners in the board frame, row by row. (rows, cols)
std::vector<Eigen::Vector3d> corners_mm(const BoardSpec& board);

// A marker's cells with its black border, row by row. (cells, cells)
struct MarkerPattern {
  int cells = 0;
  std::vector<bool> dark;
};

// The middles of the white squares in the board frame, marker 0 first. (markers)
std::vector<Eigen::Vector3d> marker_centres_mm(const BoardSpec& board);

// world_from_board of an upright board whose middle is at `centre_mm` and whose face looks to azimuth phi,
// i.e. along (cos phi, 0, sin phi): the camera of the ring at that azimuth sees it squarely.
Rigid3 upright_board(const Eigen::Vector3d& centre_mm, double azimuth_rad);

}  // namespace flamefield
