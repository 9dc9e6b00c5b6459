#include "services/report/html.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iomanip>
#include <sstream>

#include "proto/error.h"

namespace flamefield {

std::string escaped(std::string_view text) {
  std::string out;
  for (char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string base64(std::string_view bytes) {
  static constexpr char kAlphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = group << 8 | (i + k < bytes.size() ? static_cast<std::uint8_t>(bytes[i + k]) : 0u);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      out += i + k > bytes.size() ? '=' : kAlphabet[group >> (18 - 6 * k) & 63];
    }
  }
  return out;
}

std::string number(double value, int digits) {
  if (!std::isfinite(value)) return "–";
  if (value == 0) return "0";
  std::ostringstream out;
  const double size = std::abs(value);
  if (size != 0 && (size < 1e-3 || size >= 1e6)) {
    out << std::setprecision(digits) << value;
  } else {
    const int whole = size >= 1 ? static_cast<int>(std::floor(std::log10(size))) + 1 : 1;
    const int leading_zeros = size > 0 && size < 1 ? static_cast<int>(-std::floor(std::log10(size))) - 1 : 0;
    out << std::fixed << std::setprecision(std::max(0, digits - whole + leading_zeros + (size < 1 ? 1 : 0)))
        << value;
  }
  return out.str();
}

std::string inline_image(const RgbImage& image, std::string_view description, std::string_view extra) {
  return concat("<img alt=\"", escaped(description), "\" width=\"", image.width_px, "\" height=\"",
                image.height_px, "\" ", extra, " src=\"data:image/png;base64,", base64(png_from(image)),
                "\"/>");
}

std::string figure(std::string_view content, std::string_view caption, std::string_view css_class) {
  return concat("<figure class=\"", css_class, "\">", content, "<figcaption>", escaped(caption),
                "</figcaption></figure>\n");
}

std::string table(const std::vector<std::vector<std::string>>& rows, std::string_view css_class) {
  std::string out = concat("<div class=\"scroll\"><table class=\"", css_class, "\">\n");
  for (std::size_t r = 0; r < rows.size(); ++r) {
    out += r == 0 ? "<thead><tr>" : "<tr>";
    for (const std::string& cell : rows[r]) {
      out += r == 0 ? "<th>" : "<td>";
      out += cell;
      out += r == 0 ? "</th>" : "</td>";
    }
    out += r == 0 ? "</tr></thead><tbody>\n" : "</tr>\n";
  }
  return out + (rows.empty() ? "" : "</tbody>") + "</table></div>\n";
}

std::string section(std::string_view heading, std::string_view lead, std::string_view content) {
  return concat("<section>\n<h2>", escaped(heading), "</h2>\n<p class=\"lead\">", escaped(lead), "</p>\n",
                content, "</section>\n");
}

}  // namespace flamefield
