#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "services/report/rgb_image.h"

namespace flamefield {

std::string escaped(std::string_view text);  // & < > " '
std::string base64(std::string_view bytes);

// A number with so many significant digits; a dash when it is not finite.
std::string number(double value, int digits = 3);

// <img> with the picture inside. `extra` are more attributes, e.g. "class='pixels'".
std::string inline_image(const RgbImage& image, std::string_view description, std::string_view extra = {});

// <figure> around something already marked up, with a plain-text caption.
std::string figure(std::string_view content, std::string_view caption, std::string_view css_class = {});

// A table of cells that are already marked up; the first row is the head.
std::string table(const std::vector<std::vector<std::string>>& rows, std::string_view css_class = {});

// A section with an id-less heading and one sentence on how to read it.
std::string section(std::string_view heading, std::string_view lead, std::string_view content);

}  // namespace flamefield
