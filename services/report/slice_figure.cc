#include "services/report/slice_figure.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "services/report/html.h"

namespace flamefield {
namespace {

// 1, 2 or 5 times a power of ten; about three tics a range.
double tic_step(double range) {
  const double rough = range / 3, power = std::pow(10, std::floor(std::log10(rough)));
  const double lead = rough / power;
  return power * (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10);
}

std::string text(double x, double y, const char* anchor, const std::string& words,
                 const char* css_class = "tic") {
  return concat("<text x=\"", x, "\" y=\"", y, "\" text-anchor=\"", anchor, "\" class=\"", css_class, "\">",
                escaped(words), "</text>");
}

std::string png_data(const RgbImage& image) {
  return "data:image/png;base64," + base64(png_from(image));
}

}  // namespace

std::string slice_svg(const Slice& s, const ColourMap& map, ValueRange range,
                      const SliceFigureOptions& options) {
  const double width = options.px_per_mm * (s.right_mm[1] - s.right_mm[0]);
  const double height = options.px_per_mm * (s.up_mm[1] - s.up_mm[0]);
  const double left = options.label_up ? 46 : 6, top = options.title.empty() ? 6 : 22;
  const double bottom = options.label_right ? 36 : 6, right = 8;
  std::ostringstream out;
  out << std::setprecision(6) << "<svg class=\"slice\" width=\"" << left + width + right << "\" height=\""
      << top + height + bottom << "\" viewBox=\"0 0 " << left + width + right << ' ' << top + height + bottom
      << "\" xmlns=\"http://www.w3.org/2000/svg\">";
  if (!options.title.empty()) out << text(left + width / 2, 14, "middle", options.title, "name");
  out << "<image x=\"" << left << "\" y=\"" << top << "\" width=\"" << width << "\" height=\"" << height
      << "\" preserveAspectRatio=\"none\" href=\"" << png_data(coloured(s.image, map, range)) << "\"/>"
      << "<rect x=\"" << left << "\" y=\"" << top << "\" width=\"" << width << "\" height=\"" << height
      << "\" class=\"frame\"/>";
  if (options.label_right) {
    const double step = tic_step(s.right_mm[1] - s.right_mm[0]);
    for (double v = step * std::ceil(s.right_mm[0] / step); v <= s.right_mm[1]; v += step) {
      const double x = left + options.px_per_mm * (v - s.right_mm[0]);
      out << "<path class=\"frame\" d=\"M" << x << ' ' << top + height << "v4\"/>"
          << text(x, top + height + 16, "middle", number(std::round(v / step) * step, 2));
    }
    out << text(left + width / 2, top + height + 31, "middle", concat(label_of(s.right), " (mm)"));
  }
  if (options.label_up) {
    const double step = tic_step(s.up_mm[1] - s.up_mm[0]);
    for (double v = step * std::ceil(s.up_mm[0] / step); v <= s.up_mm[1]; v += step) {
      const double y = top + options.px_per_mm * (s.up_mm[1] - v);
      out << "<path class=\"frame\" d=\"M" << left << ' ' << y << "h-4\"/>"
          << text(left - 7, y + 4, "end", number(std::round(v / step) * step, 2));
    }
    out << "<text class=\"tic\" text-anchor=\"middle\" transform=\"translate(11," << top + height / 2
        << ") rotate(-90)\">" << label_of(s.up) << " (mm)</text>";
  }
  out << "</svg>";
  return out.str();
}

std::string colour_bar_svg(const ColourMap& map, ValueRange range, const std::string& label) {
  RgbImage ramp(256, 1);
  for (int i = 0; i < 256; ++i) std::copy_n(map[static_cast<std::size_t>(i)].begin(), 3, ramp.at(i, 0));
  std::ostringstream out;
  out << "<svg class=\"bar\" width=\"300\" height=\"48\" viewBox=\"0 0 300 48\" "
      << "xmlns=\"http://www.w3.org/2000/svg\"><image x=\"20\" y=\"2\" width=\"260\" height=\"10\" "
      << "preserveAspectRatio=\"none\" href=\"" << png_data(ramp) << "\"/>"
      << "<rect x=\"20\" y=\"2\" width=\"260\" height=\"10\" class=\"frame\"/>"
      << text(20, 26, "middle", number(range.low, 2))
      << text(150, 26, "middle", number(0.5 * (range.low + range.high), 2))
      << text(280, 26, "middle", number(range.high, 2)) << text(150, 43, "middle", label) << "</svg>";
  return out.str();
}

}  // namespace flamefield
