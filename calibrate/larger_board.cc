#include "calibrate/larger_board.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

namespace flamefield {

namespace {

// Grey levels of squares, named by column and row; square (0, 0) is the one between the first four corners.
class Squares {
 public:
  Squares(const cv::Mat& bytes, const std::vector<cv::Point2f>& corners, const BoardSpec& board)
      : bytes_(bytes), board_(board) {
    std::vector<cv::Point2f> grid;
    for (int row = 0; row < board.rows; ++row)
      for (int col = 0; col < board.cols; ++col)
        grid.emplace_back(static_cast<float>(col), static_cast<float>(row));
    image_from_grid_ = cv::findHomography(grid, corners);
    if (image_from_grid_.empty()) return;
    double sum[2] = {0, 0};
    int count[2] = {0, 0};
    double variance = 0;
    for (int row = 0; row + 1 < board.rows; ++row) {
      for (int col = 0; col + 1 < board.cols; ++col) {
        const auto value = level(col, row);
        if (!value) continue;
        sum[(row + col) % 2] += value->mean;
        ++count[(row + col) % 2];
        variance += value->variance;
      }
    }
    if (count[0] == 0 || count[1] == 0) return;
    spread_ = std::sqrt(variance / (count[0] + count[1]));
    middle_ = 0.5 * (sum[0] / count[0] + sum[1] / count[1]);
    half_contrast_ = 0.5 * (sum[0] / count[0] - sum[1] / count[1]);
  }

  bool is_usable() const { return std::abs(half_contrast_) > 8; }

  // Whether each square between the corners is of one grey: cells that slant across a board's squares are
  // not.
  bool are_plain() const { return spread_ < std::abs(half_contrast_); }

  // Share of the neighbours between the corners of which the right one is lighter. Light may fall off over
  // the board, so it is neighbours that are compared.
  double share_in_turn() const {
    int right = 0, all = 0;
    for (int row = 0; row + 1 < board_.rows; ++row) {
      for (int col = 0; col + 1 < board_.cols; ++col) {
        for (const cv::Point next : {cv::Point(col + 1, row), cv::Point(col, row + 1)}) {
          if (next.x + 1 >= board_.cols || next.y + 1 >= board_.rows) continue;
          const auto here = level(col, row), there = level(next.x, next.y);
          right +=
              here && there && ((row + col) % 2 == 0) == (half_contrast_ * (here->mean - there->mean) > 0);
          ++all;
        }
      }
    }
    return all > 0 ? static_cast<double>(right) / all : 1;
  }

  // Whether the squares from `first` to `last` along a column or row alternate as the pattern would.
  bool alternate(cv::Point first, cv::Point last) const {
    const cv::Point step(last.x > first.x, last.y > first.y);
    int fit = 0, all = 0;
    for (cv::Point at = first;; at += step) {
      const auto value = level(at.x, at.y);
      if (!value) return false;
      const double expected = ((at.x + at.y) % 2 == 0 ? 1 : -1) * half_contrast_;
      fit += (value->mean - middle_) * expected > 0.4 * half_contrast_ * half_contrast_;
      ++all;
      if (at == last) break;
    }
    return fit == all;
  }

 private:
  struct Level {
    double mean = 0, variance = 0;
  };

  // Over the middle of a square; none where it is not wholly in the image.
  std::optional<Level> level(int col, int row) const {
    std::vector<cv::Point2f> points, pixels;
    for (float u : {0.35f, 0.5f, 0.65f})
      for (float v : {0.35f, 0.5f, 0.65f})
        points.emplace_back(static_cast<float>(col) + u, static_cast<float>(row) + v);
    cv::perspectiveTransform(points, pixels, image_from_grid_);
    double sum = 0, squares = 0;
    for (const cv::Point2f& p : pixels) {
      const int x = cvRound(p.x), y = cvRound(p.y);
      if (x < 0 || y < 0 || x >= bytes_.cols || y >= bytes_.rows) return std::nullopt;
      const double grey = bytes_.at<unsigned char>(y, x);
      sum += grey;
      squares += grey * grey;
    }
    const double mean = sum / static_cast<double>(pixels.size());
    return Level{mean, std::max(0.0, squares / static_cast<double>(pixels.size()) - mean * mean)};
  }

  const cv::Mat& bytes_;
  const BoardSpec& board_;
  cv::Mat image_from_grid_;
  double middle_ = 0, half_contrast_ = 0, spread_ = 0;
};

}  // namespace

bool is_grid(const cv::Mat& bytes, const std::vector<cv::Point2f>& corners, const BoardSpec& board) {
  constexpr double kInTurn = 0.9;  // glare may hide a few
  const Squares squares(bytes, corners, board);
  return squares.are_plain() && squares.share_in_turn() >= kInTurn;
}

std::optional<cv::Size> larger_board(const cv::Mat& bytes, const std::vector<cv::Point2f>& corners,
                                     const BoardSpec& board) {
  const Squares squares(bytes, corners, board);
  if (!squares.is_usable()) return std::nullopt;
  // The outermost squares of the board itself are -1 and cols - 1; what lies beyond is a rim, or more of it.
  constexpr int kMost = 30;
  const int c = board.cols, r = board.rows;
  int left = 0, right = 0, above = 0, below = 0;
  while (left < kMost && squares.alternate({-2 - left, -1}, {-2 - left, r - 1})) ++left;
  while (right < kMost && squares.alternate({c + right, -1}, {c + right, r - 1})) ++right;
  while (above < kMost && squares.alternate({-1, -2 - above}, {c - 1, -2 - above})) ++above;
  while (below < kMost && squares.alternate({-1, r + below}, {c - 1, r + below})) ++below;
  if (left + right + above + below == 0) return std::nullopt;
  return cv::Size(c + left + right, r + above + below);
}

}  // namespace flamefield
