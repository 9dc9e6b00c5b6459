#include "services/report/preparation_picture.h"

#include <algorithm>
#include <cmath>

#include "proto/check.h"
#include "services/report/figure_script.h"
#include "services/report/html.h"
#include "services/report/plot.h"

namespace flamefield {
namespace {

const ColourMap& grey_map() {
  static const ColourMap map = [] {
    ColourMap out;
    for (std::size_t i = 0; i < out.size(); ++i) out[i].fill(static_cast<std::uint8_t>(i));
    return out;
  }();
  return map;
}

// From mm at the domain's centre; the projection's rows and columns are as wide as its pixels are there.
struct Millimetres {
  std::array<double, 2> across, up;
};
Millimetres millimetres(const PreparationSteps& s) {
  const double pixel_mm = s.depth_mm / s.camera.fx_px, eye_up_mm = s.camera.centre_mm().y();
  const bool is_level = std::abs(s.camera.camera_from_world.rotation(2, 1)) < 1e-6;
  const auto up = [&](double row) {
    return (is_level ? eye_up_mm : 0) + (s.camera.cy_px - row) * s.depth_mm / s.camera.fy_px;
  };
  return {{(-0.5 - s.camera.cx_px) * pixel_mm, (s.camera.image_width_px - 0.5 - s.camera.cx_px) * pixel_mm},
          {up(s.camera.image_height_px - 0.5), up(-0.5)}};
}

// As large as fits into a room, in the image's proportions; at its top, in the middle.
Box fitted(const Box& room, double width, double height) {
  const double scale = std::min(room.width / width, room.height / height);
  return {room.left + 0.5 * (room.width - scale * width), room.top, scale * width, scale * height};
}

// Gnuplot draws pixels as they are; enlarged ones stay squares.
RgbImage squares(const RgbImage& image, const Box& box) {
  RgbImage out(std::max(1, static_cast<int>(std::lround(box.width))),
               std::max(1, static_cast<int>(std::lround(box.height))));
  for (int y = 0; y < out.height_px; ++y)
    for (int x = 0; x < out.width_px; ++x)
      std::copy_n(image.at(x * image.width_px / out.width_px, y * image.height_px / out.height_px), 3,
                  out.at(x, y));
  return out;
}

RgbImage drawn(const Image& image, const Box& box, const ColourMap& map, ValueRange range) {
  const int width = static_cast<int>(std::lround(box.width)),
            height = static_cast<int>(std::lround(box.height));
  if (width <= image.width_px) return coloured(resized(image, width, height), map, range);
  return squares(coloured(image, map, range), box);
}

void draw_raw(FigureScript& script, const PreparationSteps& s, const Box& room) {
  const Box box =
      fitted({room.left, room.top, room.width - 90, room.height}, s.raw.width_px, s.raw.height_px);
  const ValueRange range{0, s.full_scale > 0 ? s.full_scale : emission_range(s.raw.pixels).high};
  script.place(box);
  script.axes(concat("sensor, mean of the frames; saturated pixels: ", s.saturated), "column (px)",
              {-0.5, s.raw.width_px - 0.5}, "row (px)", {s.raw.height_px - 0.5, -0.5});
  const double x0 = s.window.x0 - 0.5, y0 = s.window.y0 - 0.5;
  script.out() << "set object rectangle from " << x0 << ',' << y0 << " to " << x0 + s.window.width << ','
               << y0 + s.window.height << " front fs empty border lc rgb '" << kOrange << "' lw 2\n";
  script.image(drawn(s.raw, box, grey_map(), range), {-0.5, s.raw.width_px - 0.5},
               {s.raw.height_px - 0.5, -0.5});
  script.clear_marks();
  script.bar({box.left + box.width + 14, box.top, 12, box.height}, grey_map(), range, "grey level (1)");
}

void draw_corrected(FigureScript& script, const PreparationSteps& s, const Box& room) {
  const Box box =
      fitted({room.left, room.top, room.width - 90, room.height}, s.window.width, s.window.height);
  const ValueRange range = emission_range(s.corrected.pixels);
  const std::array<double, 2> right = {s.window.x0 - 0.5, s.window.x0 + s.window.width - 0.5},
                              down = {s.window.y0 + s.window.height - 0.5, s.window.y0 - 0.5};
  script.place(box);
  script.axes("the part used, corrected", "column (px)", right, "row (px)", down);
  script.image(drawn(s.corrected, box, inferno(), range), right, down);
  script.bar({box.left + box.width + 14, box.top, 12, box.height}, inferno(), range, "grey level (1)");
}

void draw_projection(FigureScript& script, const PreparationSteps& s, const Box& room,
                     const std::string& unit) {
  const Box box = fitted({room.left, room.top, room.width - 90, room.height}, s.projection.width_px,
                         s.projection.height_px);
  const ValueRange range = emission_range(s.projection.pixels);
  const Millimetres mm = millimetres(s);
  script.place(box);
  script.axes(concat("projection, ", s.projection.width_px, " × ", s.projection.height_px, " px of ",
                     number(s.depth_mm / s.camera.fx_px), " mm"),
              "across (mm)", mm.across, "HAB y (mm)", mm.up);
  script.image(drawn(s.projection, box, inferno(), range), mm.across, mm.up);
  script.bar({box.left + box.width + 14, box.top, 12, box.height}, inferno(), range,
             concat("line integral (", unit, "·mm)"));
}

// 1, 2 or 5 times a power of ten, about a third of a length.
double scale_length(double length) {
  return tic_step(4 * length / 3);
}

void draw_small(FigureScript& script, const Box& room, const Image& image, ValueRange range) {
  const Box box = fitted(room, image.width_px, image.height_px);
  script.place(box);
  script.out() << "unset title\nunset xlabel\nunset ylabel\nunset xtics\nunset ytics\nunset border\n"
               << "set xrange [0:1]\nset yrange [0:1]\n";
  script.image(drawn(image, box, inferno(), range), {0, 1}, {0, 1});
  script.clear_marks();
}

}  // namespace

Result<RgbImage> preparation_picture(const PreparationSteps& steps, const std::string& unit) {
  constexpr int kWidth = 1680, kHeight = 520;
  constexpr double kTop = 92, kRoomHeight = 400;
  FigureScript script(kWidth, kHeight, kOnPaper);
  script.text(28, 34, concat("Camera ", steps.camera.name, ": from the sensor to the projection"), 17);
  draw_raw(script, steps, {80, kTop, 540, kRoomHeight});
  draw_corrected(script, steps, {730, kTop, 420, kRoomHeight});
  draw_projection(script, steps, {1235, kTop, 425, kRoomHeight}, unit);
  return script.draw();
}

Result<RgbImage> preparation_sheet(const std::vector<PreparationSteps>& cameras, const std::string& unit) {
  expect(!cameras.empty(), "a sheet shows at least one camera");
  constexpr int kCell = 330, kCellHeight = 210, kHead = 70, kBars = 210;
  const int columns = std::min(4, static_cast<int>(cameras.size()));
  const int rows = (static_cast<int>(cameras.size()) + columns - 1) / columns;
  const int width = columns * kCell + kBars, height = kHead + std::max(rows * kCellHeight, 260) + 10;
  ValueRange grey{0, 0}, emission{0, 0};
  for (const PreparationSteps& s : cameras) {
    grey.high = std::max(grey.high, emission_range(s.corrected.pixels).high);
    emission.high = std::max(emission.high, emission_range(s.projection.pixels).high);
  }
  FigureScript script(width, height, kOnPaper);
  script.text(20, 30, "Every camera: the part of the sensor that is used, corrected, and its projection", 15);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const PreparationSteps& s = cameras[i];
    const double left = 20 + kCell * static_cast<double>(static_cast<int>(i) % columns),
                 top = kHead + kCellHeight * static_cast<double>(static_cast<int>(i) / columns);
    const Millimetres mm = millimetres(s);
    const Box room{left + 155, top, 145, 150};
    const Box box = fitted(room, s.projection.width_px, s.projection.height_px);
    const double px_per_mm = box.width / (mm.across[1] - mm.across[0]);
    const double bar_mm = scale_length(mm.across[1] - mm.across[0]);
    script.text(left, top - 8,
                concat(s.camera.name, s.saturated > 0 ? concat(", ", s.saturated, " saturated") : ""), 11,
                s.saturated > 0 ? "#b42318" : nullptr);
    const double y = 1 - (box.top + box.height + 9) / height;
    script.out() << "set arrow from screen " << box.left / width << ",screen " << y << " to screen "
                 << (box.left + bar_mm * px_per_mm) / width << ",screen " << y << " nohead lw 3 lc rgb '"
                 << kOnPaper.ink << "'\n";
    script.text(box.left + bar_mm * px_per_mm + 6, box.top + box.height + 9, concat(bar_mm, " mm"), 10,
                kOnPaper.dim);
    draw_small(script, {left, top, 145, 150}, s.corrected, grey);
    draw_small(script, room, s.projection, emission);
  }
  const double bars = columns * kCell + 20.0, bar_height = std::min(420.0, height - kHead - 40.0);
  script.bar({bars, kHead, 14, bar_height}, inferno(), grey, "corrected: grey level (1)");
  script.bar({bars + 95, kHead, 14, bar_height}, inferno(), emission,
             concat("projection: line integral (", unit, "·mm)"));
  return script.draw();
}

}  // namespace flamefield
