#include "services/report/plot.h"

#include <cmath>
#include <iomanip>
#include <sstream>

#include "proto/check.h"
#include "services/report/gnuplot.h"

namespace flamefield {
namespace {

// Stand-ins that the page replaces by its own text colour.
constexpr const char* kInk = "#010203";
constexpr const char* kGrid = "#040506";

std::string quoted(const std::string& words) {
  std::string out = "'";
  for (char c : words) {
    if (c == '\'') {
      out += "''";
    } else if (static_cast<unsigned char>(c) >= ' ') {
      out += c;
    }
  }
  return out + "'";
}

std::string clause(Mark mark, const std::string& colour) {
  const std::string line = concat(" lw 2 lc rgb '", colour, "'");
  switch (mark) {
    case Mark::Line:
      return "lines" + line;
    case Mark::Dashed:
      return "lines dt (6,5)" + line;
    case Mark::Points:
      return concat("points pt 7 ps 0.6 lc rgb '", colour, "'");
    case Mark::LinePoints:
      return "linespoints pt 7 ps 0.5" + line;
    case Mark::OpenPoints:
      return concat("points pt 6 ps 0.9 lw 1.5 lc rgb '", colour, "'");
    case Mark::Bars:
      return concat("boxes fs solid 0.85 noborder lc rgb '", colour, "'");
  }
  return "lines";
}

void write_axis(std::ostringstream& out, const char* axis, const std::string& label,
                const std::optional<std::array<double, 2>>& range, const std::vector<std::string>& names) {
  out << "set " << axis << "label " << quoted(label) << " textcolor rgb '" << kInk << "'\nset " << axis
      << "tics out nomirror scale 0.6 textcolor rgb '" << kInk << "'\n";
  if (range) out << "set " << axis << "range [" << (*range)[0] << ':' << (*range)[1] << "]\n";
  if (names.empty()) return;
  out << "set " << axis << "tics (";
  const std::size_t every = names.size() > 32 ? names.size() / 16 : 1;
  for (std::size_t i = 0; i < names.size(); i += every)
    out << (i ? ", " : "") << quoted(names[i]) << ' ' << i;
  out << ")" << (axis[0] == 'x' && names.size() > 8 ? " rotate by 50 right" : "") << '\n';
}

void write_data(std::ostringstream& out, const Plot& plot) {
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    const Series& s = plot.series[i];
    expect(s.x.size() == s.y.size(), "a series has as many x as y");
    out << "$series" << i << " << EOD\n";
    for (std::size_t k = 0; k < s.x.size(); ++k) {
      if (std::isfinite(s.x[k]) && std::isfinite(s.y[k])) out << s.x[k] << ' ' << s.y[k];
      out << '\n';
    }
    out << "EOD\n";
  }
  if (!plot.cells) return;
  const Cells& c = *plot.cells;
  out << "$cells << EOD\n";
  for (std::size_t i = 0; i < c.value.size(); ++i) {
    if (!std::isfinite(c.value[i])) continue;
    const Rgb colour = colour_of(inferno(), c.value[i], c.range.low, c.range.high);
    out << c.x[i] << ' ' << c.y[i] << ' ' << c.x[i] - c.width / 2 << ' ' << c.x[i] + c.width / 2 << ' '
        << c.y[i] - c.height / 2 << ' ' << c.y[i] + c.height / 2 << ' '
        << (colour[0] * 65536 + colour[1] * 256 + colour[2]) << '\n';
  }
  out << "EOD\n";
}

bool is_empty(const Series& series) {
  for (std::size_t k = 0; k < series.x.size(); ++k) {
    if (std::isfinite(series.x[k]) && std::isfinite(series.y[k])) return false;
  }
  return true;
}

std::string script_of(const Plot& plot, const std::string& terminal) {
  std::ostringstream out;
  out << std::setprecision(9) << "set terminal " << terminal << "\nset border 3 lc rgb '" << kInk
      << "'\nset grid lc rgb '" << kGrid
      << "' lt 1 lw 0.5\nset key outside top center horizontal samplen 2 textcolor"
      << " rgb '" << kInk << "'\nset boxwidth 0.7 relative\nset datafile missing 'NaN'\n";
  write_axis(out, "x", plot.x_label, plot.x_range, plot.x_names);
  write_axis(out, "y", plot.y_label, plot.y_range, plot.y_names);
  if (!plot.y2_label.empty()) {
    write_axis(out, "y2", plot.y2_label, plot.y2_range, {});
    out << "set border 11\n";
  }
  if (plot.log_x) out << "set logscale x\n";
  if (plot.log_y) out << "set logscale y\n";
  if (plot.equal_axes) out << "set size ratio -1\n";
  write_data(out, plot);
  std::string separator = "plot ";
  if (plot.cells) {
    out << separator
        << "$cells using 1:2:3:4:5:6:7 with boxxyerror fs solid 1 noborder lc rgb variable notitle";
    separator = ", ";
  }
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    const Series& s = plot.series[i];
    if (is_empty(s)) continue;
    out << separator << "$series" << i << " with " << clause(s.mark, s.colour)
        << (s.second_axis ? " axes x1y2" : "") << (s.name.empty() ? " notitle" : " title " + quoted(s.name));
    separator = ", ";
  }
  out << '\n';
  return out.str();
}

void replace_all(std::string& text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
}

}  // namespace

Result<std::string> svg_of(const Plot& plot, const std::string& name) {
  const ScratchFolder folder;
  const std::string terminal = concat("svg dynamic size ", plot.width_px, ',', plot.height_px,
                                      " font 'sans-serif,13' noenhanced name '", name, "'");
  auto svg = run_gnuplot(script_of(plot, terminal), folder.path());
  if (!svg) return svg;
  const std::size_t start = svg->find("<svg");
  if (start == std::string::npos) {
    return invalid_input("gnuplot drew nothing", concat("plot ", name, " has no data"),
                         "report this as a bug");
  }
  svg->erase(0, start);
  // Many plots share one page: what is named in one must not be found by another.
  for (const char* id : {"gpDot", "gpPt", "textbox", "greybox", "gnuplot_canvas"})
    replace_all(*svg, id, concat(name, "_", id));
  // The title would show as a tooltip; black and white would hide in one of the page's themes.
  if (const std::size_t title = svg->find("<title>"); title != std::string::npos) {
    svg->erase(title, svg->find("</title>") + 8 - title);
  }
  for (const char* ink : {" color=\"black\"", " color=\"white\""}) replace_all(*svg, ink, "");
  for (const char* spelling : {"rgb(  1,   2,   3)", "rgb(1,2,3)", "#010203"}) {
    replace_all(*svg, spelling, "currentColor");
  }
  for (const char* spelling : {"rgb(  4,   5,   6)", "rgb(4,5,6)", "#040506"}) {
    replace_all(*svg, concat("stroke='", spelling, "'"), "stroke='currentColor' stroke-opacity='0.16'");
  }
  return svg;
}

Result<RgbImage> png_of(const Plot& plot) {
  const ScratchFolder folder;
  std::string script = script_of(plot, concat("pngcairo size ", 2 * plot.width_px, ',', 2 * plot.height_px,
                                              " fontscale 1.6 linewidth 1.6 pointscale 1.6 background "
                                              "'#ffffff' font 'Sans,12' noenhanced"));
  replace_all(script, kGrid, "#e4e7ea");
  auto png = run_gnuplot(script, folder.path());
  if (!png) return tl::unexpected(png.error());
  return rgb_from_png(*png);
}

}  // namespace flamefield
