#include "calibrate/start.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

namespace flamefield {

namespace {

// Of the corners that the view holds.
std::vector<cv::Point3f> board_points(const BoardSpec& board, const Detection& view) {
  std::vector<cv::Point3f> points;
  const std::vector<Eigen::Vector3d> corners = corners_mm(board);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (!is_seen(view.corners_px[i])) continue;
    points.emplace_back(static_cast<float>(corners[i].x()), static_cast<float>(corners[i].y()), 0.0f);
  }
  return points;
}
std::vector<cv::Point2f> image_points(const Detection& view) {
  std::vector<cv::Point2f> points;
  for (const Eigen::Vector2d& p : view.corners_px) {
    if (!is_seen(p)) continue;
    points.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
  }
  return points;
}
cv::Matx33d matrix_of(const Camera& camera) {
  return {camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1};
}
cv::Mat coefficients_of(const Camera& camera) {
  return cv::Mat(1, 5, CV_64F, const_cast<double*>(camera.distortion.data())).clone();
}

Rigid3 rigid3_from_vectors(const cv::Mat& turn, const cv::Mat& shift) {
  cv::Matx33d r;
  cv::Rodrigues(turn, r);
  Rigid3 out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out.rotation(i, j) = r(i, j);
    out.translation_mm(i) = shift.at<double>(i);
  }
  return out;
}

double rms_px(const Camera& camera, const Rigid3& camera_from_board, const Detection& view,
              std::span<const Eigen::Vector3d> points) {
  Camera at_board = camera;
  at_board.camera_from_world = camera_from_board;
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!is_seen(view.corners_px[i])) continue;
    const auto pixel = project(at_board, points[i]);
    if (!pixel) return 1e9;
    sum += (*pixel - view.corners_px[i]).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(count_seen(view.corners_px)));
}

// Well told from its mirror first; among those, large in the image.
double rank(const Edge& edge) {
  const double distance_mm = edge.seen.camera_from_board.translation_mm.norm();
  const double facing = std::abs(edge.seen.camera_from_board.rotation(2, 2));
  return std::min(edge.seen.clarity, 5.0) + facing + 1.0 / (1.0 + distance_mm * 1e-3);
}

}  // namespace

std::optional<Camera> single_camera_start(std::span<const Detection* const> views, const BoardSpec& board) {
  if (views.empty()) return std::nullopt;
  Camera camera;
  camera.name = views[0]->camera;
  camera.image_width_px = views[0]->image_width_px;
  camera.image_height_px = views[0]->image_height_px;
  std::vector<std::vector<cv::Point3f>> objects;
  std::vector<std::vector<cv::Point2f>> images;
  for (const Detection* view : views) {
    objects.push_back(board_points(board, *view));
    images.push_back(image_points(*view));
  }
  const cv::Size size(camera.image_width_px, camera.image_height_px);
  try {
    cv::Mat k = cv::initCameraMatrix2D(objects, images, size, 1.0),
            no_distortion = cv::Mat::zeros(1, 5, CV_64F);
    const double width = camera.image_width_px;
    const double guess = k.at<double>(0, 0);
    if (!(guess > 0.3 * width && guess < 30 * width)) {
      k.at<double>(0, 0) = k.at<double>(1, 1) = 1.5 * width;
    }
    std::vector<cv::Mat> turns, shifts;
    constexpr int kFocalOnly = cv::CALIB_USE_INTRINSIC_GUESS | cv::CALIB_FIX_PRINCIPAL_POINT |
                               cv::CALIB_FIX_ASPECT_RATIO | cv::CALIB_ZERO_TANGENT_DIST | cv::CALIB_FIX_K1 |
                               cv::CALIB_FIX_K2 | cv::CALIB_FIX_K3;
    cv::calibrateCamera(objects, images, size, k, no_distortion, turns, shifts, kFocalOnly);
    camera.fx_px = k.at<double>(0, 0);
    camera.fy_px = k.at<double>(1, 1);
    camera.cx_px = k.at<double>(0, 2);
    camera.cy_px = k.at<double>(1, 2);
    if (camera.fx_px > 0.3 * width && camera.fx_px < 30 * width) return camera;
  } catch (const cv::Exception&) {
    // Degenerate views: the other cameras will lend their focal length.
  }
  return std::nullopt;
}

std::optional<SinglePose> single_pose(const Camera& camera, const Detection& view, const BoardSpec& board) {
  const std::vector<cv::Point3f> object = board_points(board, view);
  const std::vector<cv::Point2f> image = image_points(view);
  const std::vector<Eigen::Vector3d> points = corners_mm(board);
  const cv::Matx33d k = matrix_of(camera);
  const cv::Mat lens = coefficients_of(camera);
  std::vector<SinglePose> poses;
  try {
    std::vector<cv::Mat> turns, shifts;
    cv::solvePnPGeneric(object, image, k, lens, turns, shifts, false, cv::SOLVEPNP_IPPE);
    for (std::size_t i = 0; i < turns.size(); ++i) {
      cv::solvePnPRefineLM(object, image, k, lens, turns[i], shifts[i]);
      SinglePose pose;
      pose.camera_from_board = rigid3_from_vectors(turns[i], shifts[i]);
      pose.rms_px = rms_px(camera, pose.camera_from_board, view, points);
      if (pose.rms_px < 1e8) poses.push_back(pose);
    }
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
  if (poses.empty()) return std::nullopt;
  std::ranges::sort(poses, {}, &SinglePose::rms_px);
  if (poses.size() > 1) poses[0].clarity = poses[1].rms_px / std::max(poses[0].rms_px, 1e-6);
  return poses[0];
}

Chain chain_poses(std::span<const Edge> edges, std::size_t cameras, std::size_t poses,
                  std::size_t reference_pose, const Rigid3& world_from_reference) {
  Chain chain{std::vector<std::optional<Rigid3>>(cameras), std::vector<std::optional<Rigid3>>(poses)};
  chain.world_from_board[reference_pose] = world_from_reference;
  for (;;) {
    const Edge* best = nullptr;
    for (const Edge& edge : edges) {
      const bool bridges =
          chain.camera_from_world[edge.camera].has_value() != chain.world_from_board[edge.pose].has_value();
      if (bridges && (best == nullptr || rank(edge) > rank(*best))) best = &edge;
    }
    if (best == nullptr) return chain;
    auto& camera = chain.camera_from_world[best->camera];
    auto& board = chain.world_from_board[best->pose];
    if (board) {
      camera = best->seen.camera_from_board * board->inverse();
    } else {
      board = camera->inverse() * best->seen.camera_from_board;
    }
  }
}

}  // namespace flamefield
