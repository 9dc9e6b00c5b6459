#pragma once

#include <span>
#include <string_view>

namespace flamefield {

// A file of the front end (services/gateway/web), put into the program by the build.
struct WebFile {
  std::string_view path;  // "/assets/index-1a2b3c.js"
  std::string_view bytes;
  bool is_gzip = false;  // as it is sent
};
std::span<const WebFile> web_files();

// The description of the API, served as /api/v1/openapi.json.
std::string_view openapi_json();

}  // namespace flamefield
