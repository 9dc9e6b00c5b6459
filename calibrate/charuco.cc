#include "calibrate/charuco.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace flamefield {

namespace {

std::optional<int> dictionary_number(const std::string& name) {
  static constexpr const char* kNames[] = {
      "4X4_50",        "4X4_100",        "4X4_250",       "4X4_1000", "5X5_50",         "5X5_100",
      "5X5_250",       "5X5_1000",       "6X6_50",        "6X6_100",  "6X6_250",        "6X6_1000",
      "7X7_50",        "7X7_100",        "7X7_250",       "7X7_1000", "ARUCO_ORIGINAL", "APRILTAG_16h5",
      "APRILTAG_25h9", "APRILTAG_36h10", "APRILTAG_36h11"};  // in the order of OpenCV's numbers
  const auto at = std::ranges::find(kNames, name);
  if (at == std::end(kNames)) return std::nullopt;
  return static_cast<int>(at - std::begin(kNames));
}

cv::Ptr<cv::aruco::Dictionary> dictionary_of(const BoardSpec& board) {
  return cv::aruco::getPredefinedDictionary(dictionary_number(board.dictionary).value());
}

// A recognised marker: its corners in the image and on the board, clockwise from its top left.
struct Marker {
  std::vector<cv::Point2f> image, board;
};

std::vector<Marker> find_markers(const cv::Mat& bytes, const BoardSpec& board) {
  auto parameters = cv::aruco::DetectorParameters::create();
  // Small and slanted markers: thresholds over windows of a marker's size, fewer pixels a cell.
  parameters->adaptiveThreshWinSizeMin = 5;
  parameters->adaptiveThreshWinSizeMax = 45;
  parameters->adaptiveThreshWinSizeStep = 20;
  parameters->minMarkerPerimeterRate = 0.02;
  parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_NONE;
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(bytes, dictionary_of(board), corners, ids, parameters);

  const std::vector<Eigen::Vector3d> centres = marker_centres_mm(board);
  const auto half = static_cast<float>(0.5 * board.marker_mm);
  std::vector<Marker> out;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] < 0 || static_cast<std::size_t>(ids[i]) >= centres.size()) continue;
    const Eigen::Vector3d& c = centres[static_cast<std::size_t>(ids[i])];
    const cv::Point2f at(static_cast<float>(c.x()), static_cast<float>(c.y()));
    out.push_back({corners[i],
                   {at + cv::Point2f(-half, -half), at + cv::Point2f(half, -half),
                    at + cv::Point2f(half, half), at + cv::Point2f(-half, half)}});
  }
  return out;
}

cv::Mat homography(const std::vector<const Marker*>& markers, int method, double limit_px) {
  std::vector<cv::Point2f> from, to;
  for (const Marker* marker : markers) {
    from.insert(from.end(), marker->board.begin(), marker->board.end());
    to.insert(to.end(), marker->image.begin(), marker->image.end());
  }
  return cv::findHomography(from, to, method, limit_px);
}

cv::Point2f mapped(const cv::Mat& h, const cv::Point2f& p) {
  std::vector<cv::Point2f> out;
  cv::perspectiveTransform(std::vector<cv::Point2f>{p}, out, h);
  return out[0];
}

double side_px(const Marker& marker) {
  return cv::norm(marker.image[1] - marker.image[0]) + cv::norm(marker.image[2] - marker.image[1]);
}

// Markers that were read wrongly, or belong to another board, lie elsewhere.
std::vector<const Marker*> on_one_plane(const std::vector<Marker>& markers) {
  std::vector<const Marker*> all;
  for (const Marker& marker : markers) all.push_back(&marker);
  if (all.size() < 2) return {};
  const cv::Mat h = homography(all, cv::RANSAC, 4);
  if (h.empty()) return {};
  std::vector<const Marker*> good;
  for (const Marker* marker : all) {
    double worst = 0;
    for (std::size_t i = 0; i < 4; ++i)
      worst = std::max(worst, cv::norm(mapped(h, marker->board[i]) - marker->image[i]));
    if (worst < std::max(5.0, 0.15 * side_px(*marker))) good.push_back(marker);
  }
  return good.size() < 2 ? std::vector<const Marker*>() : good;
}

// The nearest markers first; a corner of the board has two right next to it.
std::vector<const Marker*> nearest(const std::vector<const Marker*>& markers, const cv::Point2f& corner_mm) {
  std::vector<const Marker*> sorted = markers;
  const auto distance = [&](const Marker* m) {
    return cv::norm(0.5f * (m->board[0] + m->board[2]) - corner_mm);
  };
  std::ranges::sort(sorted, {}, distance);
  sorted.resize(std::min<std::size_t>(sorted.size(), 4));
  return sorted;
}

// How far, along either axis of the image, the nearest corner of a marker in the corner's own squares is.
double room_px(const cv::Mat& h, const cv::Point2f& corner_mm, const BoardSpec& board) {
  const cv::Point2f at = mapped(h, corner_mm);
  const auto gap = static_cast<float>(0.5 * (board.square_mm - board.marker_mm));
  double room = 1e9;
  for (float x : {-gap, gap}) {
    for (float y : {-gap, gap}) {
      const cv::Point2f d = mapped(h, corner_mm + cv::Point2f(x, y)) - at;
      room = std::min(room, static_cast<double>(std::max(std::abs(d.x), std::abs(d.y))));
    }
  }
  return room;
}

// Enough to tell the pose of a part of the board.
bool spans_a_plane(const std::vector<Eigen::Vector2d>& corners_px, const BoardSpec& board) {
  std::vector<int> in_row(static_cast<std::size_t>(board.rows)), in_col(static_cast<std::size_t>(board.cols));
  int seen = 0;
  for (std::size_t i = 0; i < corners_px.size(); ++i) {
    if (!corners_px[i].allFinite()) continue;
    ++seen;
    ++in_row[i / static_cast<std::size_t>(board.cols)];
    ++in_col[i % static_cast<std::size_t>(board.cols)];
  }
  const auto lines = [](const std::vector<int>& counts) {
    return std::ranges::count_if(counts, [](int n) { return n >= 2; });
  };
  return seen >= 6 && lines(in_row) >= 2 && lines(in_col) >= 2;
}

}  // namespace

Result<> check_dictionary(const BoardSpec& board) {
  const auto number = dictionary_number(board.dictionary);
  if (!number) {
    return invalid_input(concat("dictionary '", board.dictionary, "'"), "ArUco has none of this name",
                         "e.g. 4X4_50, 5X5_100, 6X6_250, APRILTAG_36h11");
  }
  const int have = cv::aruco::getPredefinedDictionary(*number)->bytesList.rows;
  const auto need = static_cast<int>(marker_centres_mm(board).size());
  if (have >= need) return {};
  return invalid_input(concat("dictionary ", board.dictionary, " has ", have, " markers"),
                       concat("a board of ", board.cols, "x", board.rows, " inner corners has ", need),
                       "name the dictionary that it was printed with");
}

std::vector<MarkerPattern> marker_patterns(const BoardSpec& board) {
  const auto dictionary = dictionary_of(board);
  const int cells = dictionary->markerSize + 2;
  std::vector<MarkerPattern> out;
  for (int id = 0; id < static_cast<int>(marker_centres_mm(board).size()); ++id) {
    const cv::Mat bits =
        cv::aruco::Dictionary::getBitsFromByteList(dictionary->bytesList.rowRange(id, id + 1), cells - 2);
    MarkerPattern pattern{cells, std::vector<bool>(static_cast<std::size_t>(cells * cells), true)};
    for (int row = 0; row < cells - 2; ++row) {
      for (int col = 0; col < cells - 2; ++col)
        pattern.dark[static_cast<std::size_t>((row + 1) * cells + col + 1)] =
            bits.at<unsigned char>(row, col) == 0;
    }
    out.push_back(std::move(pattern));
  }
  return out;
}

CharucoCorners find_charuco(const cv::Mat& grey, const cv::Mat& bytes, const BoardSpec& board) {
  CharucoCorners out;
  const std::vector<Marker> found = find_markers(bytes, board);
  const std::vector<const Marker*> markers = on_one_plane(found);
  out.markers = static_cast<int>(markers.size());
  if (markers.empty()) {
    out.reason = concat("no ChArUco board: ", found.size(), " of its ", marker_centres_mm(board).size(),
                        " markers recognised");
    return out;
  }
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const cv::Rect2f inside(3, 3, static_cast<float>(grey.cols - 7), static_cast<float>(grey.rows - 7));
  for (const Eigen::Vector3d& corner : corners_mm(board)) {
    out.corners_px.emplace_back(kNan, kNan);
    const cv::Point2f at_mm(static_cast<float>(corner.x()), static_cast<float>(corner.y()));
    const std::vector<const Marker*> close = nearest(markers, at_mm);
    // Without a marker in one of its own squares a corner may be hidden.
    const cv::Point2f to_marker = 0.5f * (close[0]->board[0] + close[0]->board[2]) - at_mm;
    if (cv::norm(to_marker) > 0.8 * board.square_mm) continue;
    const cv::Mat h = homography(close, 0, 0);
    if (h.empty()) continue;
    const cv::Point2f expected = mapped(h, at_mm);
    const int window = static_cast<int>(room_px(h, at_mm, board)) - 1;
    if (!inside.contains(expected) || window < 2) continue;
    std::vector<cv::Point2f> refined = {expected};
    cv::cornerSubPix(grey, refined, cv::Size(window, window), cv::Size(-1, -1),
                     cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 40, 1e-4));
    if (cv::norm(refined[0] - expected) > std::max(1.5, 0.5 * window)) continue;
    out.corners_px.back() = {refined[0].x, refined[0].y};
  }
  if (spans_a_plane(out.corners_px, board)) return out;
  const auto seen = std::ranges::count_if(out.corners_px, [](const auto& p) { return p.allFinite(); });
  out.corners_px.clear();
  out.reason =
      concat("only ", seen, " of ", board.corners(), " inner corners of the ChArUco board are seen clearly (",
             out.markers, " markers recognised)");
  return out;
}

}  // namespace flamefield
