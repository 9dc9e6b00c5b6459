#include "services/calibration/flame_check.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "calibrate/median.h"
#include "reconstruct/render.h"
#include "reconstruct/solver.h"

namespace flamefield {

namespace {

// The views at `keep`, and their cameras.
Projections views_of(const Projections& all, const std::vector<std::size_t>& keep) {
  Projections out;
  out.rows = all.rows;
  out.cols = all.cols;
  for (std::size_t v : keep) {
    out.view_names.push_back(all.view_names[v]);
    const auto view = all.view(v);
    out.values.insert(out.values.end(), view.begin(), view.end());
  }
  return out;
}

// What is known of a shift d and a gain g with measured(x) = g expected(x - d), linearised about d = 0.
struct Registration {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();

  // About a shift that was found before: expected(x - d0) is sampled between its pixels.
  void add(const Image& expected, std::span<const float> measured, const Eigen::Vector2d& before) {
    for (int y = 1; y + 1 < expected.height_px; ++y) {
      for (int x = 1; x + 1 < expected.width_px; ++x) {
        const double u = x - before.x(), v = y - before.y();
        const double middle = at(expected, u, v);
        const double du = 0.5 * (at(expected, u + 1, v) - at(expected, u - 1, v)),
                     dv = 0.5 * (at(expected, u, v + 1) - at(expected, u, v - 1));
        const Eigen::Vector3d row(-du, -dv, middle);
        const auto i = static_cast<std::size_t>(y) * static_cast<std::size_t>(expected.width_px) +
                       static_cast<std::size_t>(x);
        normal += row * row.transpose();
        right += row * static_cast<double>(measured[i]);
      }
    }
  }

  // The step of the shift; the brightness is fitted along.
  std::optional<Eigen::Vector2d> step() const {
    const Eigen::FullPivLU<Eigen::Matrix3d> lu(normal);
    if (!lu.isInvertible()) return std::nullopt;
    const Eigen::Vector3d solved = lu.solve(right);
    if (!(solved.z() > 1e-6)) return std::nullopt;
    return Eigen::Vector2d(solved.head<2>() / solved.z());
  }

 private:
  static double at(const Image& image, double x, double y) {
    x = std::clamp(x, 0.0, image.width_px - 1.001);
    y = std::clamp(y, 0.0, image.height_px - 1.001);
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    const double s = x - i, t = y - j;
    return (1 - t) * ((1 - s) * double(image.at(i, j)) + s * double(image.at(i + 1, j))) +
           t * ((1 - s) * double(image.at(i, j + 1)) + s * double(image.at(i + 1, j + 1)));
  }
};

class Checker {
 public:
  Checker(const Rig& rig, const Grid& grid, std::span<const Projections> sets,
          const FlameCheckOptions& options)
      : rig_(rig), grid_(grid), sets_(sets), options_(options) {
    recipe_.solver = "mlem";
    recipe_.settings["mlem.max_iterations"] = std::int64_t{options.iterations};
  }

  // By the cameras in `trusted` other than the view's own.
  Result<Eigen::Vector2d> shift(std::size_t view, const std::vector<std::size_t>& trusted) const {
    std::vector<std::size_t> others;
    for (std::size_t v : trusted)
      if (v != view) others.push_back(v);
    const Camera& camera = rig_.cameras[*rig_.find(sets_[0].view_names[view])];
    std::vector<Image> expected;
    for (const Projections& set : sets_) {
      if (options_.stop.stop_requested())
        return unavailable("checking the cameras", "stopped", "run it again");
      SolveControl control;
      control.threads = options_.threads;
      control.stop = options_.stop;
      const auto field = reconstruct(views_of(set, others), rig_of(others), grid_, recipe_, control);
      if (!field) return tl::unexpected(field.error());
      expected.push_back(render_view(field->volume, camera, {.threads = options_.threads}));
    }
    Eigen::Vector2d shift(0, 0);
    constexpr int kRounds = 4;
    for (int round = 0; round < kRounds; ++round) {
      Registration all;
      for (std::size_t s = 0; s < sets_.size(); ++s) all.add(expected[s], sets_[s].view(view), shift);
      const auto step = all.step();
      if (!step) {
        return invalid_input(concat("view ", sets_[0].view_names[view]), "it is dark or without structure",
                             "check with a brighter flame");
      }
      constexpr double kLongest_px = 3;  // as far as a straight line tells anything
      shift += *step * std::min(1.0, kLongest_px / std::max(1e-12, step->norm()));
    }
    return shift;
  }

 private:
  Rig rig_of(const std::vector<std::size_t>& views) const {
    Rig out;
    for (std::size_t v : views) out.cameras.push_back(rig_.cameras[*rig_.find(sets_[0].view_names[v])]);
    return out;
  }

  const Rig& rig_;
  const Grid& grid_;
  std::span<const Projections> sets_;
  const FlameCheckOptions& options_;
  Recipe recipe_;
};

Result<> check_input(const Rig& rig, std::span<const Projections> sets) {
  if (sets.empty())
    return invalid_input("no pictures of a flame", "nothing to check", "give one set or more");
  constexpr std::size_t kFewest = 5;
  for (const Projections& set : sets) {
    if (set.views() < kFewest) {
      return invalid_input(concat(set.views(), " views"),
                           "fewer than five cannot tell which camera has moved",
                           "use more cameras, or a board");
    }
    if (set.view_names != sets[0].view_names || set.rows != sets[0].rows || set.cols != sets[0].cols)
      return invalid_input("sets of different views", "they are looked at together", "check them one by one");
    for (const std::string& name : set.view_names) {
      const auto at = rig.find(name);
      if (!at)
        return invalid_input(concat("view ", name, " is not in the rig"), "its place is unknown",
                             "use the rig of these pictures");
      if (rig.cameras[*at].image_width_px != set.cols || rig.cameras[*at].image_height_px != set.rows)
        return invalid_input(
            concat("view ", name, " is ", set.cols, "x", set.rows, " px"),
            concat("the rig has ", rig.cameras[*at].image_width_px, "x", rig.cameras[*at].image_height_px),
            "use the rig that 'flamefield prepare --rig-out' wrote");
    }
  }
  return {};
}

}  // namespace

Result<FlameCheck> check_by_flame(const Rig& rig, const Grid& grid, std::span<const Projections> sets,
                                  const FlameCheckOptions& options) {
  if (auto ok = check_input(rig, sets); !ok) return tl::unexpected(ok.error());
  const Checker checker(rig, grid, sets, options);
  FlameCheck out;
  std::vector<std::size_t> trusted;
  for (std::size_t v = 0; v < sets[0].views(); ++v) {
    out.cameras.push_back({sets[0].view_names[v], {0, 0}, false});
    trusted.push_back(v);
  }
  for (;;) {
    std::vector<double> sizes;
    for (std::size_t v = 0; v < out.cameras.size(); ++v) {
      const auto shift = checker.shift(v, trusted);
      if (!shift) return tl::unexpected(shift.error());
      out.cameras[v].shift_px = *shift;
      if (!out.cameras[v].moved) sizes.push_back(shift->norm());
    }
    out.typical_px = median(sizes);
    const double limit = std::max(options.moved_px, options.moved_factor * out.typical_px);
    std::optional<std::size_t> worst;
    for (std::size_t v : trusted) {
      const double size = out.cameras[v].shift_px.norm();
      if (size > limit && (!worst || size > out.cameras[*worst].shift_px.norm())) worst = v;
    }
    // Half of the ring has to agree for the other half to be wrong.
    if (!worst || 2 * (trusted.size() - 1) < out.cameras.size()) return out;
    out.cameras[*worst].moved = true;
    out.moved.push_back(out.cameras[*worst].camera);
    std::erase(trusted, *worst);
  }
}

}  // namespace flamefield
