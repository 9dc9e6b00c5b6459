#include "services/report/figure_script.h"

#include <cmath>
#include <fstream>
#include <iomanip>
#include <utility>

namespace flamefield {

double tic_step(double range) {
  const double rough = std::abs(range) / 4, power = std::pow(10, std::floor(std::log10(rough)));
  const double lead = rough / power;
  return power * (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10);
}

FigureScript::FigureScript(int width_px, int height_px, const FigureColours& colours)
    : width_px_(width_px), height_px_(height_px), colours_(colours) {
  out_ << std::setprecision(9) << "set terminal pngcairo size " << width_px << ',' << height_px
       << " background '" << colours.background << "' font 'Sans,12' noenhanced\nset multiplot\nunset key\n";
}

void FigureScript::place(const Box& box) {
  const double w = width_px_, h = height_px_;
  out_ << "set lmargin at screen " << box.left / w << "\nset rmargin at screen " << (box.left + box.width) / w
       << "\nset tmargin at screen " << 1 - box.top / h << "\nset bmargin at screen "
       << 1 - (box.top + box.height) / h << '\n';
}

void FigureScript::axes(const std::string& title, const std::string& right, std::array<double, 2> right_range,
                        const std::string& up, std::array<double, 2> up_range) {
  out_ << "set border 15 lc rgb '" << colours_.frame << "'\nset title " << quoted(title)
       << " font 'Sans,12' textcolor rgb '" << colours_.ink << "' offset 0,-0.4\nset xlabel " << quoted(right)
       << " textcolor rgb '" << colours_.ink << "' offset 0,0.3\nset ylabel " << quoted(up)
       << " textcolor rgb '" << colours_.ink << "' offset 1,0\n";
  for (const auto& [axis, range] : {std::pair("x", right_range), std::pair("y", up_range)}) {
    out_ << "set " << axis << "range [" << range[0] << ':' << range[1] << "]\nset " << axis << "tics "
         << tic_step(range[1] - range[0]) << " out nomirror scale 0.6 textcolor rgb '" << colours_.dim
         << "'\n";
  }
}

void FigureScript::text(double x_px, double y_px, const std::string& words, int size, const char* colour,
                        const char* align) {
  out_ << "set label " << quoted(words) << " at screen " << x_px / width_px_ << ", screen "
       << 1 - y_px / height_px_ << ' ' << align << " font 'Sans," << size << "' textcolor rgb '"
       << (colour ? colour : colours_.ink) << "'\n";
}

std::string FigureScript::image_clause(const std::vector<std::uint8_t>& bytes, int width, int height,
                                       std::array<double, 2> right, std::array<double, 2> up) {
  const auto path = folder_.path() / concat("image", images_++, ".rgb");
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  // gnuplot wants positive steps: an axis that runs down has its first row at the lower number.
  const bool is_flipped = up[1] > up[0];
  const double dx = (right[1] - right[0]) / width, dy = std::abs(up[1] - up[0]) / height;
  std::ostringstream clause;
  clause << std::setprecision(9) << quoted(path.string()) << " binary array=(" << width << ',' << height
         << ") " << (is_flipped ? "flip=y " : "") << "dx=" << dx << " dy=" << dy << " origin=("
         << right[0] + dx / 2 << ',' << std::min(up[0], up[1]) + dy / 2 << ") format='%uchar' using ";
  return clause.str();
}

void FigureScript::image(const RgbImage& image, std::array<double, 2> right, std::array<double, 2> up) {
  const std::string clause = image_clause(image.bytes, image.width_px, image.height_px, right, up);
  out_ << "plot " << clause << "1:2:3 with rgbimage\n";
}

void FigureScript::bar(const Box& box, const ColourMap& map, ValueRange range, const std::string& label) {
  RgbImage ramp(2, 256);
  for (int y = 0; y < 256; ++y)
    for (int x = 0; x < 2; ++x) std::copy_n(map[static_cast<std::size_t>(255 - y)].begin(), 3, ramp.at(x, y));
  place(box);
  out_ << "unset title\nunset xlabel\nunset ylabel\nunset xtics\nunset ytics\nset border 15 lc rgb '"
       << colours_.frame << "'\nset xrange [0:1]\nset yrange [" << range.low << ':' << range.high
       << "]\nset y2range [" << range.low << ':' << range.high << "]\nset y2tics "
       << tic_step(range.high - range.low) << " out scale 0.6 textcolor rgb '" << colours_.dim
       << "'\nset y2label " << quoted(label) << " offset -0.8,0 textcolor rgb '" << colours_.ink << "'\n";
  image(ramp, {0, 1}, {range.low, range.high});
  out_ << "unset y2tics\nunset y2label\n";
}

std::string FigureScript::quoted(const std::string& words) {
  std::string out = "'";
  for (char c : words) {
    if (c == '\'')
      out += "''";
    else if (static_cast<unsigned char>(c) >= ' ')
      out += c;
  }
  return out + "'";
}

Result<RgbImage> FigureScript::draw() {
  auto png = run_gnuplot(out_.str(), folder_.path());
  if (!png) return tl::unexpected(png.error());
  return rgb_from_png(*png);
}

}  // namespace flamefield
