#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "calibrate/connect.h"
#include "calibrate/sightings.h"

namespace flamefield {

// A turn of the board about its normal after which it looks the same: corner i then lies where `from[i]` was.
struct BoardTurn {
  Rigid3 turn;                    // board_from_turned_board
  std::vector<std::size_t> from;  // (rows, cols)
};

// The identity first; ChArUco boards have nothing else. Boards with one odd and one even side have nothing
// else; other oblong boards and square ones of odd side look the same after half a turn, square ones of even
// side after every quarter.
std::vector<BoardTurn> look_alike_turns(const BoardSpec& board);

std::vector<Eigen::Vector2d> reordered(const std::vector<Eigen::Vector2d>& corners_px, const BoardTurn& turn);

// Which of the look-alike turns puts each view's corners into one order per pose.
struct CornerOrder {
  std::vector<std::size_t> turn;  // (views)
  std::vector<bool> settled;      // (views); false: too few views of its camera agree to tell
};

// Where two cameras see a board, a view that is numbered from the other end gives another relative pose. The
// true one recurs in every pose, wrong ones do not, as they depend on where the board looks. So cameras join
// one after another, the most clearly told first, each where most of its views agree. The order within a pose
// is free; it is the one that most views of the pose already have.
CornerOrder agree_on_order(const Sightings& sightings, const Starts& starts, const BoardSpec& board);

}  // namespace flamefield
