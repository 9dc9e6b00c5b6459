#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "proto/board.h"
#include "proto/error.h"
#include "proto/image.h"

namespace flamefield {

// What one camera saw of one board pose: grey levels on any scale.
struct BoardView {
  std::string camera;
  std::string pose;  // views of one pose show the board at one place
  Image image;
};

struct Detection {
  std::string camera;
  std::string pose;
  int image_width_px = 0;
  int image_height_px = 0;
  // (rows, cols) of the board; empty when it was not found. Where only a part of a ChArUco board is seen, the
  // other corners are not numbers (see is_seen).
  std::vector<Eigen::Vector2d> corners_px;
  std::string reason;  // why not

  bool found() const { return !corners_px.empty(); }
};

inline bool is_seen(const Eigen::Vector2d& corner_px) {
  return corner_px.allFinite();
}
std::size_t count_seen(std::span<const Eigen::Vector2d> corners_px);

struct DetectOptions {
  int threads = 0;                                      // 0: all cores
  std::function<void(std::size_t done)> progress = {};  // called from the workers, one at a time
};

// Finds all inner corners of the board in one image, in the board's order (see proto/board.h). Boards that
// look the same when turned (see corner_order.h) are taken to stand upright; calibrate() finds out those that
// do not. findChessboardCornersSB, then cornerSubPix with a half-window of 0.45 of the smallest corner
// spacing: a window that reaches the next corner is off by pixels on slanted boards. ChArUco boards: see
// charuco.h.
Detection detect_board(const BoardView& view, const BoardSpec& board);

// The board of `before` in a later picture of the same camera, in which it has moved by less than half a
// square: a hundredth of the work of finding it. None when it is not there any more.
std::optional<Detection> track_board(const BoardView& view, const Detection& before, const BoardSpec& board);

// All views in parallel, in the order given; the same for any number of threads.
Result<std::vector<Detection>> detect(std::span<const BoardView> views, const BoardSpec& board,
                                      const DetectOptions& options = {});

}  // namespace flamefield
