#pragma once

#include <array>
#include <cstdint>
#include <sstream>
#include <string>
#include <vector>

#include "services/report/gnuplot.h"
#include "services/report/rgb_image.h"

namespace flamefield {

struct Box {  // px, from the top left of the picture
  double left = 0, top = 0, width = 0, height = 0;
};

struct FigureColours {
  const char *background, *ink, *dim, *frame;
};
constexpr FigureColours kOnDark = {"#0b0d12", "#c9d1d9", "#8b949e", "#3d444d"};
constexpr FigureColours kOnPaper = {"#ffffff", "#1f2328", "#59636e", "#9aa4ae"};

// 1, 2 or 5 times a power of ten, so that a range gets three to six tics.
double tic_step(double range);

// A picture of many parts, each in its box, as one gnuplot script.
class FigureScript {
 public:
  FigureScript(int width_px, int height_px, const FigureColours& colours);

  std::ostringstream& out() { return out_; }
  const FigureColours& colours() const { return colours_; }
  void place(const Box& box);

  // Titles, ranges and about four tics an axis. A range may run backwards.
  void axes(const std::string& title, const std::string& right, std::array<double, 2> right_range,
            const std::string& up, std::array<double, 2> up_range);

  // Text placed on the whole picture, drawn by the next plot; `colour` null: the ink.
  void text(double x_px, double y_px, const std::string& words, int size, const char* colour = nullptr,
            const char* align = "left");

  // Image bytes to a file; gnuplot's clause that reads them, its pixels spread over a range of both axes with
  // the first row at up[1].
  std::string image_clause(const std::vector<std::uint8_t>& bytes, int width, int height,
                           std::array<double, 2> right, std::array<double, 2> up);
  // Draws an image in the current axes.
  void image(const RgbImage& image, std::array<double, 2> right, std::array<double, 2> up);
  // An upright colour bar with its quantity beside it.
  void bar(const Box& box, const ColourMap& map, ValueRange range, const std::string& label);
  void clear_marks() { out_ << "unset arrow\nunset label\nunset object\n"; }

  static std::string quoted(const std::string& words);
  Result<RgbImage> draw();

 private:
  int width_px_, height_px_;
  FigureColours colours_;
  ScratchFolder folder_;
  std::ostringstream out_;
  int images_ = 0;
};

}  // namespace flamefield
