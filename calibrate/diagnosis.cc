#include "calibrate/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calibrate/median.h"
#include "proto/error.h"

namespace flamefield {

namespace {

// What a saturated pixel of such a sensor reads, for whole grey levels; 0 for any other scale.
double full_scale(const cv::Mat& grey) {
  double low = 0, high = 0;
  cv::minMaxLoc(grey, &low, &high);
  cv::Mat whole;
  grey.convertTo(whole, CV_32S);
  whole.convertTo(whole, CV_32F);
  if (low < 0 || cv::norm(grey, whole, cv::NORM_INF) > 0) return 0;
  for (double bits : {8, 10, 12, 14, 16}) {
    const double full = std::exp2(bits) - 1;
    if (high <= full) return full;
  }
  return 0;
}

// Sigma of the pixels' noise, from the median of second differences: edges are few.
double noise_of(const cv::Mat& grey) {
  std::vector<double> differences;
  for (int y = 1; y + 1 < grey.rows; y += 3) {
    const auto *above = grey.ptr<float>(y - 1), *row = grey.ptr<float>(y), *below = grey.ptr<float>(y + 1);
    for (int x = 1; x + 1 < grey.cols; x += 3)
      differences.push_back(std::abs(4 * row[x] - row[x - 1] - row[x + 1] - above[x] - below[x]));
  }
  if (differences.empty()) return 0;
  return median(std::move(differences)) / (0.6745 * std::sqrt(20.0));
}

// The board that is really there, if the detector finds a complete one of any size.
struct OtherBoard {
  bool is_part = false;  // of the board that was looked for
  std::string text;
};
std::optional<OtherBoard> other_board(const cv::Mat& bytes, const BoardSpec& board) {
  std::vector<cv::Point2f> points;
  cv::Mat meta;
  try {
    if (!cv::findChessboardCornersSB(bytes, cv::Size(3, 3), points, cv::CALIB_CB_LARGER, meta))
      return std::nullopt;
  } catch (const cv::Exception&) {
    return std::nullopt;  // the detector gives up on some textures
  }
  const int longer = std::max(meta.cols, meta.rows), shorter = std::min(meta.cols, meta.rows);
  const int wanted = std::max(board.cols, board.rows), narrow = std::min(board.cols, board.rows);
  if (shorter < 3 || (longer == wanted && shorter == narrow)) return std::nullopt;
  // A part of the board itself may be all that is seen.
  if (longer <= wanted && shorter <= narrow)
    return OtherBoard{true, concat("part of a board: looked for ", board.cols, "x", board.rows, " inner corners, found ",
                                   longer, "x", shorter, " (another board, or the rest is hidden)")};
  return OtherBoard{false, concat("another board: looked for ", board.cols, "x", board.rows,
                                  " inner corners, found ", longer, "x", shorter)};
}

// Grid vectors at each point: to its nearest neighbour, and to the nearest in another direction. Under weak
// perspective the singular values of the two have the ratio of the cosine of the obliquity.
std::optional<double> obliquity_deg(const std::vector<cv::Point>& points) {
  std::vector<double> cosines;
  for (const cv::Point& p : points) {
    std::vector<cv::Point> steps;
    for (const cv::Point& q : points)
      if (q != p) steps.push_back(q - p);
    std::ranges::sort(steps, {}, [](const cv::Point& s) { return s.dot(s); });
    if (steps.size() < 2) return std::nullopt;
    const cv::Point2d a = steps[0];
    const auto other = std::ranges::find_if(steps, [&](const cv::Point& s) {
      return std::abs(a.cross(s)) > 0.5 * cv::norm(a) * cv::norm(cv::Point2d(s));
    });
    if (other == steps.end()) continue;
    const cv::Point2d b = *other;
    const double sum = a.dot(a) + b.dot(b), area = std::abs(a.cross(b));
    const double root = std::sqrt(std::max(0.0, sum * sum - 4 * area * area));
    cosines.push_back(std::sqrt((sum - root) / (sum + root)));
  }
  if (cosines.empty()) return std::nullopt;
  return std::acos(std::min(1.0, median(std::move(cosines)))) * 180 / std::numbers::pi;
}

std::optional<std::string> edge_touched(const cv::Rect& box, const cv::Size& image, double margin_px) {
  std::string edges;
  int count = 0;
  const auto add = [&](bool touches, const char* name) {
    if (!touches) return;
    edges += concat(edges.empty() ? "" : " and ", name);
    ++count;
  };
  add(box.x < margin_px, "left");
  add(box.y < margin_px, "upper");
  add(box.br().x > image.width - margin_px, "right");
  add(box.br().y > image.height - margin_px, "lower");
  if (count == 0 || count > 2) return std::nullopt;  // points all over the image are a cluttered room
  return concat("cut off at the ", edges, count == 1 ? " edge" : " edges", " of the image");
}

// A board out of focus has its corners only where the picture is reduced.
bool is_blurred(const cv::Mat& bytes, const CornerRegion& region, const BoardSpec& board) {
  const int enough = static_cast<int>(board.corners()) * 6 / 10;
  if (region.candidates() >= enough) return false;
  for (double factor : {0.5, 0.25, 0.125}) {
    cv::Mat reduced;
    cv::resize(bytes, reduced, {}, factor, factor, cv::INTER_AREA);
    if (corner_region(reduced).candidates() >= enough) return true;
  }
  return false;
}

}  // namespace

std::optional<std::string> exposure_fault(const cv::Mat& grey) {
  const cv::Mat sorted = grey.clone().reshape(1, 1);
  std::vector<float> levels(sorted.begin<float>(), sorted.end<float>());
  const auto at = [&](double share) {
    const auto n = static_cast<std::ptrdiff_t>(share * static_cast<double>(levels.size() - 1));
    std::nth_element(levels.begin(), levels.begin() + n, levels.end());
    return static_cast<double>(levels[static_cast<std::size_t>(n)]);
  };
  const double low = at(0.01), high = at(0.99), full = full_scale(grey), noise = noise_of(grey);
  if (full > 0 && high < 0.06 * full)
    return concat("too dark: 99 % of the grey levels are below ", high + 1, " of ", full);
  if (noise > 0 && high - low < 10 * noise) {
    return concat("too dark or empty: the contrast is only ", std::lround((high - low) / noise),
                  " times the noise");
  }
  if (full == 0) return std::nullopt;
  const auto saturated = std::ranges::count_if(levels, [&](float level) { return level >= 0.995 * full; });
  const double share = static_cast<double>(saturated) / static_cast<double>(levels.size());
  if (share > 0.1) return concat("overexposed: ", std::lround(100 * share), " % of the pixels are saturated");
  return std::nullopt;
}

std::string why_not_found(const cv::Mat& grey, const cv::Mat& bytes, const CornerRegion& region,
                          const BoardSpec& board) {
  if (const auto fault = exposure_fault(grey)) return *fault;
  if (is_blurred(bytes, region, board)) return "blurred: corners appear only in the reduced picture";
  const int few = static_cast<int>(board.corners()) / 4;
  if (region.candidates() < few) return concat("no board: ", region.candidates(), " corner-like points");
  const double angle = obliquity_deg(region.points).value_or(0);
  const double pitch_px = std::sqrt(region.box.area() / static_cast<double>(board.corners()));
  if (angle >= 62) return concat("too oblique: turned by about ", std::lround(angle), " degrees");
  const auto seen = other_board(bytes, board);
  if (seen && seen->is_part) {
    // Where the rest is missing at the edge of the image, that is the reason.
    if (const auto edge = edge_touched(region.box, bytes.size(), 0.8 * pitch_px)) return *edge;
  }
  if (seen) return seen->text;
  if (const auto edge = edge_touched(region.box, bytes.size(), 0.8 * pitch_px)) return *edge;
  return concat("board not found among ", region.candidates(), " corner-like points");
}

}  // namespace flamefield
