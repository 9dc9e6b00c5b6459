#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "proto/error.h"
#include "services/report/rgb_image.h"

namespace flamefield {

// Colours that can be told apart by everyone, on white and on near-black (after Okabe and Ito 2008).
constexpr const char* kBlue = "#3d8fd1";
constexpr const char* kOrange = "#e08214";
constexpr const char* kGreen = "#1b9e77";
constexpr const char* kRed = "#d6604d";
constexpr const char* kGrey = "#8b949e";

enum class Mark { Line, Dashed, Points, LinePoints, OpenPoints, Bars };

// Points that are not finite break a line and are not drawn.
struct Series {
  std::string name;  // in the key; none when empty
  std::vector<double> x, y;
  Mark mark = Mark::Line;
  std::string colour = kBlue;
  bool second_axis = false;  // y to the right
};

// Little boxes of one size, coloured by value with inferno: density and matrix plots.
struct Cells {
  std::vector<double> x, y, value;  // centres
  double width = 1, height = 1;
  ValueRange range;
};

struct Plot {
  std::string x_label, y_label;  // with units
  std::string y2_label = {};     // given when a series uses the second axis
  std::optional<std::array<double, 2>> x_range = {}, y_range = {}, y2_range = {};
  bool log_x = false, log_y = false;
  bool equal_axes = false;                // one unit is as long along x as along y
  std::vector<std::string> x_names = {};  // tics 0, 1, 2, ... by name
  std::vector<std::string> y_names = {};
  std::vector<Series> series = {};
  std::optional<Cells> cells = {};
  int width_px = 620, height_px = 360;
};

// An <svg> element to be put into a page; ink follows the page's text colour. `name` is unique in the page.
Result<std::string> svg_of(const Plot& plot, const std::string& name);

// The same on white, at twice the size.
Result<RgbImage> png_of(const Plot& plot);

}  // namespace flamefield
