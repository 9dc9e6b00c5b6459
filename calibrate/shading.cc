#include "calibrate/shading.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace flamefield {

namespace {

struct Sample {
  cv::Point2f at;
  double level;
};

// Mean over the middle of the square between four corners; none where it is not wholly in the picture.
std::optional<Sample> sample_of(const cv::Mat& grey, const std::vector<cv::Point2f>& corners, int first,
                                int cols) {
  const auto at = [&](int i) { return corners[static_cast<std::size_t>(i)]; };
  const cv::Point2f a = at(first), b = at(first + 1), c = at(first + cols), d = at(first + cols + 1);
  double sum = 0;
  int count = 0;
  for (float u : {0.3f, 0.4f, 0.5f, 0.6f, 0.7f}) {
    for (float v : {0.3f, 0.4f, 0.5f, 0.6f, 0.7f}) {
      const cv::Point2f p = (1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * c + u * d);
      const int x = cvRound(p.x), y = cvRound(p.y);
      if (x < 0 || y < 0 || x >= grey.cols || y >= grey.rows) return std::nullopt;
      sum += grey.at<float>(y, x);
      ++count;
    }
  }
  return Sample{0.25f * (a + b + c + d), sum / count};
}

// level = p[0] + p[1] x + p[2] y
std::optional<Eigen::Vector3d> plane_through(const std::vector<Sample>& samples) {
  if (samples.size() < 4) return std::nullopt;
  Eigen::MatrixX3d a(samples.size(), 3);
  Eigen::VectorXd b(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    a.row(row) << 1, samples[i].at.x, samples[i].at.y;
    b[row] = samples[i].level;
  }
  const auto solver = a.colPivHouseholderQr();
  if (solver.rank() < 3) return std::nullopt;
  return solver.solve(b);
}

}  // namespace

cv::Mat without_shading(const cv::Mat& grey, const std::vector<cv::Point2f>& corners_px,
                        const BoardSpec& board) {
  std::vector<Sample> squares[2];
  for (int row = 0; row + 1 < board.rows; ++row) {
    for (int col = 0; col + 1 < board.cols; ++col) {
      if (const auto sample = sample_of(grey, corners_px, row * board.cols + col, board.cols))
        squares[(row + col) % 2].push_back(*sample);
    }
  }
  auto dark = plane_through(squares[0]), white = plane_through(squares[1]);
  if (!dark || !white) return grey;
  const cv::Point2f middle = corners_px[corners_px.size() / 2];
  const Eigen::Vector3d here(1, middle.x, middle.y);
  if (dark->dot(here) > white->dot(here)) std::swap(dark, white);
  const double contrast = white->dot(here) - dark->dot(here);
  if (!(contrast > 0)) return grey;
  cv::Rect region = cv::boundingRect(corners_px);  // and the windows around its corners
  region =
      (region - cv::Point(region.width, region.height) / 4 + region.size() / 2) & cv::Rect({}, grey.size());
  cv::Mat even = grey.clone();
  for (int y = region.y; y < region.br().y; ++y) {
    const float* in = grey.ptr<float>(y);
    float* out = even.ptr<float>(y);
    for (int x = region.x; x < region.br().x; ++x) {
      const Eigen::Vector3d p(1, x, y);
      const double low = dark->dot(p), span = std::max(white->dot(p) - low, 0.2 * contrast);
      out[x] = static_cast<float>((in[x] - low) / span);
    }
  }
  return even;
}

}  // namespace flamefield
