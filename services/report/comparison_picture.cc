#include "services/report/comparison_picture.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "proto/check.h"
#include "services/report/field_plots.h"
#include "services/report/figure_script.h"
#include "services/report/html.h"
#include "services/report/slices.h"

namespace flamefield {
namespace {

struct Cut {
  Axis axis;
  int index;
};
constexpr std::size_t kUpright = 2;  // the first cuts, which share the height as their upward axis

// Both vertical central planes, and horizontal ones at a tenth, three tenths ... of the height.
std::vector<Cut> cuts(const Grid& g) {
  std::vector<Cut> out = {{Axis::X, central_layer(g, Axis::X)}, {Axis::Z, central_layer(g, Axis::Z)}};
  for (int tenth = 1; tenth <= 9; tenth += 2) out.push_back({Axis::Y, g.ny * tenth / 10});
  return out;
}

double length_mm(const Grid& g, Axis axis) {
  const auto i = static_cast<Eigen::Index>(axis);
  return g.upper_mm()[i] - g.lower_mm()[i];
}

// One scale for all slices, so that a millimetre is a millimetre everywhere.
struct Arrangement {
  double px_per_mm = 1, row_height = 0;
  std::vector<double> left, width, height;
};
constexpr double kLeft = 206, kGap = 46, kUpLabel = 26, kBars = 130, kHead = 92, kBetween = 66;

Arrangement arrange(const Grid& g, const std::vector<Cut>& all, double picture_width) {
  double total_mm = 0, tallest_mm = 0;
  std::vector<std::array<double, 2>> sizes_mm;
  for (const Cut& cut : all) {
    const Axis right = cut.axis == Axis::X ? Axis::Z : Axis::X, up = cut.axis == Axis::Y ? Axis::Z : Axis::Y;
    sizes_mm.push_back({length_mm(g, right), length_mm(g, up)});
    total_mm += sizes_mm.back()[0];
    tallest_mm = std::max(tallest_mm, sizes_mm.back()[1]);
  }
  Arrangement out;
  const double room = picture_width - kLeft - kBars - kUpLabel - kGap * static_cast<double>(all.size());
  out.px_per_mm = std::min(room / total_mm, 330 / tallest_mm);
  out.row_height = std::max(8.0, tallest_mm * out.px_per_mm);
  double left = kLeft;
  for (const auto& size : sizes_mm) {
    if (out.left.size() == kUpright) left += kUpLabel;
    out.left.push_back(left);
    out.width.push_back(std::max(4.0, size[0] * out.px_per_mm));
    out.height.push_back(std::max(4.0, size[1] * out.px_per_mm));
    left += out.width.back() + kGap;
  }
  return out;
}

void draw(FigureScript& script, const Slice& s, const Box& box, const ColourMap& map, ValueRange range,
          bool with_title, bool with_right_label, bool with_up_label) {
  std::ostringstream title;
  if (with_title) title << label_of(s.normal) << " = " << std::setprecision(3) << s.position_mm << " mm";
  script.place(box);
  script.axes(title.str(), with_right_label ? concat(label_of(s.right), " (mm)") : "", s.right_mm,
              with_up_label ? concat(label_of(s.up), " (mm)") : "", s.up_mm);
  if (!with_right_label) script.out() << "set format x ''\n";
  const Image image =
      resized(s.image, static_cast<int>(std::lround(box.width)), static_cast<int>(std::lround(box.height)));
  script.image(coloured(image, map, range), s.right_mm, s.up_mm);
  script.out() << "set format x\n";
  script.clear_marks();
}

}  // namespace

Result<RgbImage> comparison_picture(const Volume& truth, const Volume& volume, const FieldMetrics& metrics,
                                    const std::string& unit) {
  expect(truth.grid.voxels() == volume.grid.voxels(), "both fields have one grid");
  const Grid& g = volume.grid;
  const std::vector<Cut> all = cuts(g);
  constexpr int kWidth = 1800;
  const Arrangement at = arrange(g, all, kWidth);
  const ValueRange range = emission_range(truth.values);
  const Volume wrong = difference(volume, truth);
  double largest = 1e-12 * range.high;
  for (float v : wrong.values) largest = std::max(largest, std::abs(static_cast<double>(v)));
  const double picture_width = at.left.back() + at.width.back() + kBars + 30;
  const int height = static_cast<int>(kHead + 3 * at.row_height + kBetween + 30 + 60);
  FigureScript script(static_cast<int>(picture_width), height, kOnPaper);
  const std::array<double, 3> tops = {kHead, kHead + at.row_height + kBetween,
                                      kHead + 2 * at.row_height + kBetween + 30};
  script.text(24, 32,
              concat("Known and reconstructed field: Pearson ", number(metrics.pearson, 4), ", SqMD ",
                     number(metrics.sqmd, 3), " (3D)"),
              16);
  const std::array<const char*, 3> names = {"known", "reconstructed", "difference"};
  for (std::size_t row = 0; row < 3; ++row) script.text(24, tops[row] + at.row_height / 2, names[row], 13);
  script.text(24, tops[0] + at.row_height + kBetween / 2 + 2, "correlation", 12);
  script.text(24, tops[0] + at.row_height + kBetween / 2 + 20, "SqMD", 12);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const SliceMetrics& m =
        metrics.slices[static_cast<std::size_t>(all[i].axis)].at(static_cast<std::size_t>(all[i].index));
    const double middle = at.left[i] + at.width[i] / 2, y = tops[0] + at.row_height + kBetween / 2;
    script.text(middle, y + 2, number(m.pearson, 3), 12, nullptr, "center");
    script.text(middle, y + 20, number(m.sqmd, 3), 12, nullptr, "center");
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    const std::array<const Volume*, 3> rows = {&truth, &volume, &wrong};
    for (std::size_t row = 0; row < 3; ++row) {
      const Box box{at.left[i], tops[row] + at.row_height - at.height[i], at.width[i], at.height[i]};
      draw(script, slice(*rows[row], all[i].axis, all[i].index), box, row == 2 ? cool_warm() : inferno(),
           row == 2 ? ValueRange{-largest, largest} : range, row == 0, row == 2, i == 0 || i == kUpright);
    }
  }
  const double bars = at.left.back() + at.width.back() + 30;
  script.bar({bars, tops[0], 14, 2 * at.row_height + kBetween}, inferno(), range,
             concat("emission (", unit, ")"));
  script.bar({bars, tops[2], 14, at.row_height}, cool_warm(), {-largest, largest},
             concat("difference (", unit, ")"));
  return script.draw();
}

}  // namespace flamefield
