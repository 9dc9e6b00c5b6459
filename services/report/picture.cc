#include "services/report/picture.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "services/report/figure_script.h"
#include "services/report/slices.h"
#include "services/report/volume_view.h"

namespace flamefield {
namespace {

// Where everything stands: slices share one scale (px per mm), the rendered view takes the room they leave.
struct Layout {
  Box view, front, side, top, profile, bar;
};

Layout arrange(const Grid& grid, const VolumePictureOptions& options) {
  constexpr double kLeft = 70, kTitle = 32, kBottom = 66, kGap = 22, kHead = 56, kBar = 138, kEdge = 24;
  const Eigen::Vector3d size_mm = grid.upper_mm() - grid.lower_mm();
  const double room_w = 0.56 * options.width_px - kBar - 2 * kLeft - kGap;
  const double room_h = options.height_px - kHead - 2 * (kTitle + kBottom);
  const double scale = std::min(room_w / (size_mm.x() + size_mm.z()), room_h / (size_mm.y() + size_mm.z()));
  const double wx = std::max(8.0, scale * size_mm.x()), wz = std::max(8.0, scale * size_mm.z()),
               hy = std::max(8.0, scale * size_mm.y());
  const double block_h = hy + wz + 2 * kTitle + 2 * kBottom;
  const double y0 = kHead + std::max(0.0, (options.height_px - kHead - block_h) / 2) + kTitle;
  const double x2 = options.width_px - kBar - wz, x1 = x2 - kLeft - kGap - wx;
  const double y2 = y0 + hy + kBottom + kTitle;
  Layout out;
  out.front = {x1, y0, wx, hy};
  out.side = {x2, y0, wz, hy};
  out.top = {x1, y2, wx, wz};
  out.profile = {x2, y2, wz, wz};
  out.bar = {options.width_px - kBar + 34, y0, 16, y2 + wz - y0};
  const double view_w = x1 - kLeft - kEdge - 16;
  out.view = {kEdge, kHead + 40, view_w, options.height_px - kHead - 40 - kEdge};
  return out;
}

void draw_slice(FigureScript& script, const Slice& s, const Box& box, const ValueRange& range,
                const Eigen::Vector3d& cut_mm) {
  const int w = static_cast<int>(std::lround(box.width)), h = static_cast<int>(std::lround(box.height));
  const RgbImage picture = coloured(resized(s.image, w, h), inferno(), range);
  script.place(box);
  const auto at = [&](Axis axis) { return cut_mm[static_cast<Eigen::Index>(axis)]; };
  std::ostringstream& out = script.out();
  std::ostringstream title;
  title << label_of(s.normal) << " = " << std::setprecision(3) << s.position_mm << " mm";
  script.axes(title.str(), concat(label_of(s.right), " (mm)"), s.right_mm, concat(label_of(s.up), " (mm)"),
              s.up_mm);
  // Where the other two slices cut this one.
  out << "set arrow from first " << at(s.right) << ",graph 0 to first " << at(s.right)
      << ",graph 1 nohead front dt (4,6) lc rgb '#90ffffff'\nset arrow from graph 0,first " << at(s.up)
      << " to graph 1,first " << at(s.up) << " nohead front dt (4,6) lc rgb '#90ffffff'\n";
  script.image(picture, s.right_mm, s.up_mm);
  script.clear_marks();
}

void draw_edges(std::ostringstream& out, const Grid& grid, const Camera& camera, double height_px) {
  const Eigen::Vector3d low = grid.lower_mm(), high = grid.upper_mm();
  const auto corner = [&](unsigned i) {
    return Eigen::Vector3d(i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(),
                           i & 4 ? high.z() : low.z());
  };
  unsigned farthest = 0;
  const Eigen::Vector3d eye = camera.centre_mm();
  for (unsigned i = 1; i < 8; ++i) {
    if ((corner(i) - eye).norm() > (corner(farthest) - eye).norm()) farthest = i;
  }
  const Eigen::Vector2d middle = *project(camera, 0.5 * (low + high));
  for (unsigned i = 0; i < 8; ++i) {
    for (unsigned axis = 0; axis < 3; ++axis) {
      const unsigned j = i ^ (1u << axis);
      if (j < i) continue;
      const Eigen::Vector2d a = *project(camera, corner(i)), b = *project(camera, corner(j));
      const bool hidden = i == farthest || j == farthest;
      out << "set arrow from " << a.x() << ',' << height_px - a.y() << " to " << b.x() << ','
          << height_px - b.y() << " nohead "
          << (hidden ? "back lc rgb '#262c36'" : "front lc rgb '#b0ffffff'") << '\n';
      // One edge an axis carries its name and length: the outermost ones, below and to the left.
      const bool near_bottom = !hidden && axis != 1 && !(i & 2);
      const bool left_side =
          axis == 1 && !hidden && 0.5 * (a + b).x() < middle.x() - 1 && ((i ^ farthest) & 5) != 5;
      if (!near_bottom && !left_side) continue;
      const Eigen::Vector2d at = 0.5 * (a + b);
      const Eigen::Vector2d offset = axis == 1 ? Eigen::Vector2d(-16, 0) : Eigen::Vector2d(0, 22);
      const double length_mm = (high - low)[static_cast<Eigen::Index>(axis)];
      out << "set label '" << label_of(static_cast<Axis>(axis)) << "  " << std::setprecision(3) << length_mm
          << std::setprecision(9) << " mm' at " << at.x() + offset.x() << ','
          << height_px - at.y() - offset.y()
          << (axis == 1             ? " center rotate by 90"
              : at.x() < middle.x() ? " right"
                                    : " left")
          << " textcolor rgb '" << kOnDark.dim << "' font 'Sans,11'\n";
    }
  }
}

void draw_view(FigureScript& script, const Volume& volume, const Box& box, double high,
               const VolumePictureOptions& options) {
  VolumeViewOptions view;
  view.width_px = static_cast<int>(std::lround(box.width));
  view.height_px = static_cast<int>(std::lround(box.height));
  view.azimuth_rad = options.azimuth_rad;
  view.elevation_rad = options.elevation_rad;
  view.high = high;
  const Camera camera = turntable_camera(volume.grid, view);
  const RgbaImage image = ray_cast(volume, camera, view);
  script.place(box);
  std::ostringstream& out = script.out();
  out << "unset border\nunset tics\nunset xlabel\nunset ylabel\nunset title\nset xrange [0:" << view.width_px
      << "]\nset yrange [0:" << view.height_px << "]\n";
  draw_edges(out, volume.grid, camera, view.height_px);
  out << "plot "
      << script.image_clause(image.bytes, view.width_px, view.height_px,
                             {0, static_cast<double>(view.width_px)},
                             {0, static_cast<double>(view.height_px)})
      << "1:2:3:4 with rgbalpha\nunset arrow\nunset label\n";
}

void draw_profile(FigureScript& script, const Volume& volume, const Box& box, const std::string& unit) {
  const std::vector<double> mean = mean_by_height(volume);
  script.place(box);
  std::ostringstream& out = script.out();
  out << "$profile << EOD\n";
  double top = 0;
  for (int y = 0; y < volume.grid.ny; ++y) {
    const double value = mean[static_cast<std::size_t>(y)];
    out << volume.grid.voxel_centre_mm(0, y, 0).y() << ' ' << value << '\n';
    top = std::max(top, value);
  }
  out << "EOD\n";
  script.axes("mean of each layer", "HAB y (mm)", {volume.grid.lower_mm().y(), volume.grid.upper_mm().y()},
              "emission (" + unit + ")", {0, top > 0 ? 1.1 * top : 1});
  out << "set border 3\n"
      << "set grid lc rgb '#20262e' lt 1\nset style fill transparent solid 0.25 noborder\n"
      << "plot $profile with filledcurves y1=0 lc rgb '#f98e09', '' with lines lw 2 lc rgb '#f98e09'\n"
      << "unset grid\n";
}

Result<> check(const Volume& volume) {
  if (volume.values.empty() || volume.values.size() != volume.grid.voxels()) {
    return invalid_input("a volume without values cannot be drawn", "it has no voxels",
                         "reconstruct or load one first");
  }
  if (const auto bad = std::ranges::find_if_not(volume.values, [](float v) { return std::isfinite(v); });
      bad != volume.values.end()) {
    return invalid_input(concat("voxel ", bad - volume.values.begin(), " is NaN or infinite"),
                         "a picture would hide it", "repair the volume first");
  }
  return validate(volume.grid);
}

}  // namespace

Result<RgbImage> volume_picture(const Volume& volume, const VolumePictureOptions& options) {
  if (auto ok = check(volume); !ok) return tl::unexpected(ok.error());
  const Grid& g = volume.grid;
  const Layout layout = arrange(g, options);
  ValueRange range = emission_range(volume.values);
  if (options.high > 0) range.high = options.high;

  FigureScript script(options.width_px, options.height_px, kOnDark);
  script.text(40, 40, options.title, 21, "#ffffff");
  const std::string grid_text =
      concat(g.nx, " × ", g.ny, " × ", g.nz, " voxels of ", g.spacing_mm.x(), " mm");
  script.text(40, 72, options.subtitle.empty() ? grid_text : concat(options.subtitle, "   ·   ", grid_text),
              12, kOnDark.dim);
  draw_view(script, volume, layout.view, range.high, options);
  const std::array<const Box*, 3> boxes = {&layout.side, &layout.top, &layout.front};
  Eigen::Vector3d cut_mm;
  std::array<Slice, 3> cuts;
  for (Axis axis : kAxes) {
    const auto i = static_cast<std::size_t>(axis);
    cuts[i] = slice(volume, axis, central_layer(g, axis));
    cut_mm[static_cast<Eigen::Index>(i)] = cuts[i].position_mm;
  }
  for (std::size_t i = 0; i < 3; ++i) draw_slice(script, cuts[i], *boxes[i], range, cut_mm);
  draw_profile(script, volume, layout.profile, options.unit);
  script.bar(layout.bar, inferno(), range, concat("emission (", options.unit, ")"));
  return script.draw();
}

}  // namespace flamefield
