#include "calibrate/corner_order.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "calibrate/start.h"

namespace flamefield {

namespace {

// A camera pose that one view, numbered one way, speaks for.
struct Candidate {
  std::size_t view = 0;
  std::size_t pose = 0;
  std::size_t turn = 0;
  Rigid3 camera_from_root;
};

// Single views are good to a degree, chains of them to a few; wrong orders are off by up to half a turn.
bool agree(const Rigid3& a, const Rigid3& b) {
  const double trace = a.rotation.cwiseProduct(b.rotation).sum();
  constexpr double kCosLimit = 0.978;  // 12 degrees
  if (0.5 * (trace - 1) < kCosLimit) return false;
  const Eigen::Vector3d &s = a.translation_mm, &t = b.translation_mm;
  return (s - t).norm() <= 0.2 * std::max(s.norm(), t.norm());
}

struct Vote {
  int best = 0, second = 0;
  Rigid3 camera_from_root;

  int margin() const { return best >= 2 ? best - second : 0; }
};

// Poses, not candidates, have votes.
int supporters(const std::vector<Candidate>& candidates, const Rigid3& camera_from_root) {
  int count = 0;
  std::size_t last = kNotSolved;
  for (const Candidate& c : candidates) {
    if (c.pose == last || !agree(c.camera_from_root, camera_from_root)) continue;
    last = c.pose;
    ++count;
  }
  return count;
}

Vote vote(const std::vector<Candidate>& candidates) {
  Vote out;
  std::vector<int> support;
  for (const Candidate& c : candidates) {
    support.push_back(supporters(candidates, c.camera_from_root));
    if (support.back() <= out.best) continue;
    out.best = support.back();
    out.camera_from_root = c.camera_from_root;
  }
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (!agree(candidates[i].camera_from_root, out.camera_from_root))
      out.second = std::max(out.second, support[i]);
  }
  return out;
}

class Consensus {
 public:
  Consensus(const Sightings& sightings, const Starts& starts, const BoardSpec& board)
      : sightings_(sightings),
        turns_(look_alike_turns(board)),
        seen_(sightings.views.size()),
        root_from_board_(sightings.poses.size()),
        joined_(sightings.cameras.size(), false) {
    out_.turn.assign(seen_.size(), 0);
    out_.settled.assign(seen_.size(), true);
    if (turns_.size() == 1) return;
    for (std::size_t v = 0; v < seen_.size(); ++v) {
      const Sightings::View& view = sightings.views[v];
      if (!view.detection->found()) continue;
      if (const auto pose = single_pose(*starts.cameras[view.camera], *view.detection, board))
        seen_[v] = pose->camera_from_board;
    }
  }

  CornerOrder settle() {
    if (turns_.size() == 1) return out_;
    join(busiest_camera(), Rigid3());
    for (;;) {
      std::optional<std::size_t> next;
      Vote clearest;
      for (std::size_t c = 0; c < joined_.size(); ++c) {
        if (joined_[c]) continue;
        const Vote of_camera = vote(candidates(c));
        if (of_camera.margin() <= clearest.margin()) continue;
        clearest = of_camera;
        next = c;
      }
      if (!next) break;
      join(*next, clearest.camera_from_root);
    }
    for (std::size_t v = 0; v < seen_.size(); ++v) {
      if (seen_[v] && !joined_[sightings_.views[v].camera]) out_.settled[v] = false;
    }
    for (std::size_t p = 0; p < root_from_board_.size(); ++p) keep_most(p);
    return out_;
  }

 private:
  std::size_t busiest_camera() const {
    std::vector<int> views(joined_.size(), 0);
    for (std::size_t v = 0; v < seen_.size(); ++v) views[sightings_.views[v].camera] += seen_[v].has_value();
    return static_cast<std::size_t>(std::ranges::max_element(views) - views.begin());
  }

  // From the views of boards that joined cameras have placed, grouped by pose.
  std::vector<Candidate> candidates(std::size_t camera) const {
    std::vector<Candidate> out;
    for (std::size_t v = 0; v < seen_.size(); ++v) {
      const Sightings::View& view = sightings_.views[v];
      if (view.camera != camera || !seen_[v] || !root_from_board_[view.pose]) continue;
      const Rigid3 board_from_root = root_from_board_[view.pose]->inverse();
      for (std::size_t k = 0; k < turns_.size(); ++k)
        out.push_back({v, view.pose, k, *seen_[v] * turns_[k].turn * board_from_root});
    }
    return out;
  }

  // Numbers the views of boards that have been placed, and places the others.
  void join(std::size_t camera, const Rigid3& camera_from_root) {
    joined_[camera] = true;
    std::vector<double> closeness(seen_.size(), -4);  // trace of the relative rotation
    for (const Candidate& c : candidates(camera)) {
      const double trace = c.camera_from_root.rotation.cwiseProduct(camera_from_root.rotation).sum();
      if (trace <= closeness[c.view]) continue;
      closeness[c.view] = trace;
      out_.turn[c.view] = c.turn;
    }
    for (std::size_t v = 0; v < seen_.size(); ++v) {
      const Sightings::View& view = sightings_.views[v];
      if (view.camera == camera && seen_[v] && !root_from_board_[view.pose])
        root_from_board_[view.pose] = camera_from_root.inverse() * *seen_[v];
    }
  }

  // Turns the whole pose so that as few of its views as possible are renumbered.
  void keep_most(std::size_t pose) {
    const std::size_t n = turns_.size();
    std::vector<int> count(n, 0);
    for (std::size_t v = 0; v < seen_.size(); ++v)
      if (sightings_.views[v].pose == pose && seen_[v]) ++count[out_.turn[v]];
    const auto most = static_cast<std::size_t>(std::ranges::max_element(count) - count.begin());
    for (std::size_t v = 0; v < seen_.size(); ++v)
      if (sightings_.views[v].pose == pose && seen_[v]) out_.turn[v] = (out_.turn[v] + n - most) % n;
  }

  const Sightings& sightings_;
  const std::vector<BoardTurn> turns_;
  std::vector<std::optional<Rigid3>> seen_;             // camera_from_board of each view, as it is numbered
  std::vector<std::optional<Rigid3>> root_from_board_;  // one for each pose
  std::vector<bool> joined_;                            // one for each camera
  CornerOrder out_;
};

}  // namespace

std::vector<BoardTurn> look_alike_turns(const BoardSpec& board) {
  const bool square = board.cols == board.rows, even = board.cols % 2 == 0;
  const int step = board.kind == BoardKind::Charuco     ? 4
                   : square && even                     ? 1
                   : (board.cols + board.rows) % 2 == 0 ? 2
                                                        : 4;  // quarters
  const std::vector<Eigen::Vector3d> corners = corners_mm(board);
  std::vector<BoardTurn> turns;
  for (int quarters = 0; quarters < 4; quarters += step) {
    BoardTurn turn;
    turn.turn.rotation =
        Eigen::AngleAxisd(0.5 * std::numbers::pi * quarters, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    for (const Eigen::Vector3d& corner : corners) {
      const Eigen::Vector3d there = turn.turn * corner;
      const auto at = std::ranges::min_element(
          corners, {}, [&](const Eigen::Vector3d& c) { return (c - there).squaredNorm(); });
      turn.from.push_back(static_cast<std::size_t>(at - corners.begin()));
    }
    turns.push_back(std::move(turn));
  }
  return turns;
}

std::vector<Eigen::Vector2d> reordered(const std::vector<Eigen::Vector2d>& corners_px,
                                       const BoardTurn& turn) {
  std::vector<Eigen::Vector2d> out;
  for (std::size_t from : turn.from) out.push_back(corners_px[from]);
  return out;
}

CornerOrder agree_on_order(const Sightings& sightings, const Starts& starts, const BoardSpec& board) {
  return Consensus(sightings, starts, board).settle();
}

}  // namespace flamefield
