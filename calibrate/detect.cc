#include "calibrate/detect.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "calibrate/charuco.h"
#include "calibrate/corner_order.h"
#include "calibrate/corner_region.h"
#include "calibrate/diagnosis.h"
#include "calibrate/larger_board.h"
#include "calibrate/shading.h"

namespace flamefield {

namespace {

// Grey levels at the 1st and 99th percentile of a sparse sample.
struct Span {
  float low = 0, high = 0;
};
Span grey_span(const Image& image) {
  std::vector<float> sample;
  for (std::size_t i = 0; i < image.pixels.size(); i += 17) sample.push_back(image.pixels[i]);
  const auto at = [&](double share) {
    const auto n = static_cast<std::ptrdiff_t>(share * static_cast<double>(sample.size() - 1));
    std::nth_element(sample.begin(), sample.begin() + n, sample.end());
    return sample[static_cast<std::size_t>(n)];
  };
  return {at(0.01), at(0.99)};
}

// OpenCV only reads through this header.
cv::Mat header_of(const Image& image) {
  return {image.height_px, image.width_px, CV_32F, const_cast<float*>(image.pixels.data())};
}

// 8 bits over the span, for the detector; the refinement uses the original levels.
cv::Mat to_bytes(const cv::Mat& grey, const Span& span) {
  cv::Mat bytes;
  const double scale = 255.0 / std::max(1e-12, double(span.high) - span.low);
  grey.convertTo(bytes, CV_8U, scale, -scale * span.low);
  return bytes;
}

// Corner (row, col) of a grid that is stored row by row.
struct CornerGrid {
  const BoardSpec& board;
  std::vector<cv::Point2f>& points;
  cv::Point2f& at(int row, int col) const {
    return points[static_cast<std::size_t>(row) * static_cast<std::size_t>(board.cols) +
                  static_cast<std::size_t>(col)];
  }
};

double smallest_spacing_px(const CornerGrid& grid) {
  double smallest = 1e9;
  for (int row = 0; row < grid.board.rows; ++row) {
    for (int col = 0; col < grid.board.cols; ++col) {
      if (col > 0) smallest = std::min(smallest, cv::norm(grid.at(row, col) - grid.at(row, col - 1)));
      if (row > 0) smallest = std::min(smallest, cv::norm(grid.at(row, col) - grid.at(row - 1, col)));
    }
  }
  return smallest;
}

int half_window_px(const CornerGrid& grid) {
  return std::max(2, static_cast<int>(0.45 * smallest_spacing_px(grid)));
}

void refine(const cv::Mat& grey, std::vector<cv::Point2f>& points, int half_window) {
  cv::cornerSubPix(grey, points, cv::Size(half_window, half_window), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 40, 1e-4));
}

// Seen from the front, columns run clockwise ahead of rows (image y points down).
bool is_mirrored(const CornerGrid& grid) {
  double area = 0;
  for (int row = 1; row < grid.board.rows; ++row) {
    for (int col = 1; col < grid.board.cols; ++col) {
      area += (grid.at(row - 1, col) - grid.at(row - 1, col - 1))
                  .cross(grid.at(row, col - 1) - grid.at(row - 1, col - 1));
    }
  }
  return area < 0;
}

// Mean level of the squares whose row + column is even, minus that of the others.
double even_minus_odd(const CornerGrid& grid, const cv::Mat& bytes) {
  double sum[2] = {0, 0};
  int count[2] = {0, 0};
  for (int row = 1; row < grid.board.rows; ++row) {
    for (int col = 1; col < grid.board.cols; ++col) {
      const cv::Point2f centre = 0.25f * (grid.at(row, col) + grid.at(row - 1, col) + grid.at(row, col - 1) +
                                          grid.at(row - 1, col - 1));
      const int x = cvRound(centre.x), y = cvRound(centre.y);
      if (x < 0 || y < 0 || x >= bytes.cols || y >= bytes.rows) continue;
      sum[(row + col) % 2] += bytes.at<unsigned char>(y, x);
      ++count[(row + col) % 2];
    }
  }
  return sum[0] / std::max(1, count[0]) - sum[1] / std::max(1, count[1]);
}

void quarter_turn(const CornerGrid& grid) {
  const std::vector<cv::Point2f> before = grid.points;
  const int n = grid.board.cols;
  for (int row = 0; row < n; ++row) {
    for (int col = 0; col < n; ++col)
      grid.at(row, col) = before[static_cast<std::size_t>((n - 1 - col) * n + row)];
  }
}

// Of the ways in which a board looks the same, the one whose rows run most nearly down the image.
void set_upright(const CornerGrid& grid) {
  const std::vector<cv::Point2f> before = grid.points;
  float best = -1e9f;
  for (const BoardTurn& turn : look_alike_turns(grid.board)) {
    const float down = before[turn.from.back()].y - before[turn.from.front()].y +
                       before[turn.from[turn.from.size() - static_cast<std::size_t>(grid.board.cols)]].y -
                       before[turn.from[static_cast<std::size_t>(grid.board.cols) - 1]].y;
    if (down <= best) continue;
    best = down;
    for (std::size_t i = 0; i < before.size(); ++i) grid.points[i] = before[turn.from[i]];
  }
}

// Puts the corners into the board's order; none when they cannot be that board's.
bool normalise_order(const CornerGrid& grid, const cv::Mat& bytes) {
  if (is_mirrored(grid)) {
    for (int row = 0; row < grid.board.rows; ++row) {
      for (int col = 0; col < grid.board.cols / 2; ++col) {
        std::swap(grid.at(row, col), grid.at(row, grid.board.cols - 1 - col));
      }
    }
  }
  const double contrast = even_minus_odd(grid, bytes);
  const bool odd_square = grid.board.cols == grid.board.rows && grid.board.cols % 2 == 1;
  if (contrast > 0 && odd_square) quarter_turn(grid);
  if (contrast > 0 && (grid.board.cols + grid.board.rows) % 2 == 1)
    std::reverse(grid.points.begin(), grid.points.end());  // turned by 180 degrees
  set_upright(grid);
  return std::abs(contrast) > 10;
}

// Room for the outer squares and the white rim around the corners seen.
cv::Rect with_rim(const cv::Rect& box, const cv::Size& image) {
  const int x = box.width * 4 / 10 + 10, y = box.height * 4 / 10 + 10;
  return cv::Rect(box.x - x, box.y - y, box.width + 2 * x, box.height + 2 * y) & cv::Rect({}, image);
}

// Empty when the board is not found. Half the size is a quarter of the work and enough for most boards, as
// the corners are refined on the original afterwards; the exhaustive search finds a few more.
std::vector<cv::Point2f> find_corners(const cv::Mat& bytes, const BoardSpec& board, const cv::Rect& region) {
  const cv::Mat part = bytes(region);
  cv::Mat half;
  cv::resize(part, half, {}, 0.5, 0.5, cv::INTER_AREA);
  struct Try {
    const cv::Mat& image;
    float scale;
    int flags;
  };
  const cv::Size size(board.cols, board.rows);
  std::vector<cv::Point2f> points;
  for (const Try& attempt : {Try{half, 2, 0}, Try{part, 1, 0},
                             Try{part, 1, cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE}}) {
    if (!cv::findChessboardCornersSB(attempt.image, size, points, attempt.flags)) continue;
    const float shift = 0.5f * (attempt.scale - 1);  // centre of the first merged pixel
    for (cv::Point2f& p : points)
      p = attempt.scale * p + cv::Point2f(shift, shift) + cv::Point2f(region.tl());
    return points;
  }
  return {};
}

}  // namespace

std::size_t count_seen(std::span<const Eigen::Vector2d> corners_px) {
  return static_cast<std::size_t>(std::ranges::count_if(corners_px, is_seen));
}

Detection detect_board(const BoardView& view, const BoardSpec& board) {
  Detection out{view.camera, view.pose, view.image.width_px, view.image.height_px, {}, {}};
  if (view.image.pixels.empty()) {
    out.reason = "empty image";
    return out;
  }
  const Span span = grey_span(view.image);
  const cv::Mat grey = header_of(view.image);
  if (!(span.high > span.low)) {
    out.reason = exposure_fault(grey).value_or("no contrast");
    return out;
  }
  const cv::Mat bytes = to_bytes(grey, span);
  if (board.kind == BoardKind::Charuco) {
    CharucoCorners found = find_charuco(grey, bytes, board);
    out.corners_px = std::move(found.corners_px);
    if (!out.found()) out.reason = exposure_fault(grey).value_or(found.reason);
    return out;
  }
  const CornerRegion region = corner_region(bytes);
  cv::theRNG() = cv::RNG(1);  // OpenCV's detector draws samples: the same picture has the same corners
  std::vector<cv::Point2f> points;
  if (2 * region.candidates() >= static_cast<int>(board.corners()))
    points = find_corners(bytes, board, with_rim(region.box, bytes.size()));
  if (points.size() != board.corners()) {
    out.reason = why_not_found(grey, bytes, region, board);
    return out;
  }
  if (!is_grid(bytes, points, board)) {
    out.reason = concat("another board: what was found makes no grid of ", board.cols, "x", board.rows,
                        " inner corners");
    return out;
  }
  if (const auto larger = larger_board(bytes, points, board)) {
    out.reason =
        concat("another board: looked for ", board.cols, "x", board.rows, " inner corners, found ",
               std::max(larger->width, larger->height), "x", std::min(larger->width, larger->height));
    return out;
  }
  const CornerGrid grid{board, points};
  refine(without_shading(grey, points, board), points, half_window_px(grid));
  if (!normalise_order(grid, bytes)) {
    out.reason = "squares have no clear colours";
    return out;
  }
  for (const cv::Point2f& p : points) out.corners_px.emplace_back(p.x, p.y);
  return out;
}

std::optional<Detection> track_board(const BoardView& view, const Detection& before, const BoardSpec& board) {
  if (!before.found() || view.image.width_px != before.image_width_px ||
      view.image.height_px != before.image_height_px)
    return std::nullopt;
  if (board.kind == BoardKind::Charuco) {  // whose corners' windows are for find_charuco to know
    Detection again = detect_board(view, board);
    return again.found() ? std::optional(std::move(again)) : std::nullopt;
  }
  std::vector<cv::Point2f> points;
  for (const Eigen::Vector2d& p : before.corners_px)
    points.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
  const std::vector<cv::Point2f> start = points;
  const CornerGrid grid{board, points};
  const int window = half_window_px(grid);
  const cv::Mat grey = header_of(view.image);
  refine(without_shading(grey, points, board), points, window);
  // A picture without the board leaves the points where they are, or scatters them.
  const Span span = grey_span(view.image);
  if (!(span.high > span.low)) return std::nullopt;
  const bool is_there = std::abs(even_minus_odd(grid, to_bytes(grey, span))) > 25;
  double square_sum = 0;
  cv::Point2f mean(0, 0);
  for (std::size_t i = 0; i < points.size(); ++i)
    mean += (points[i] - start[i]) / static_cast<float>(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    square_sum += std::pow(cv::norm(points[i] - start[i] - mean), 2);
  const double scatter_px = std::sqrt(square_sum / static_cast<double>(points.size()));
  if (!is_there || scatter_px > 0.25 * window) return std::nullopt;
  Detection out{view.camera, view.pose, view.image.width_px, view.image.height_px, {}, {}};
  for (const cv::Point2f& p : points) out.corners_px.emplace_back(p.x, p.y);
  return out;
}

Result<std::vector<Detection>> detect(std::span<const BoardView> views, const BoardSpec& board,
                                      const DetectOptions& options) {
  if (auto ok = validate(board); !ok) return tl::unexpected(ok.error());
  if (board.kind == BoardKind::Charuco) {
    if (auto ok = check_dictionary(board); !ok) return tl::unexpected(ok.error());
  }
  // One image per worker; OpenCV's own threads would only get in the way of ours.
  static std::once_flag once;
  std::call_once(once, [] { cv::setNumThreads(1); });

  std::vector<Detection> detections(views.size());
  std::atomic<std::size_t> next = 0;
  std::mutex report_mutex;
  std::size_t done = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < views.size(); i = next++) {
      detections[i] = detect_board(views[i], board);
      if (!options.progress) continue;
      const std::scoped_lock lock(report_mutex);
      options.progress(++done);
    }
  };
  const std::size_t wanted = options.threads > 0 ? static_cast<std::size_t>(options.threads)
                                                 : std::max(1u, std::thread::hardware_concurrency());
  {
    std::vector<std::jthread> workers;
    for (std::size_t t = 1; t < std::min(wanted, views.size()); ++t) workers.emplace_back(work);
    work();
  }
  return detections;
}

}  // namespace flamefield
