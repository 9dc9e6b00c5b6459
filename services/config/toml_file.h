#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "proto/recipe.h"

namespace flamefield {

// One key of a TOML file with the line where it stands.
struct TomlEntry {
  std::vector<Setting> values;  // one, unless it is a list
  bool is_list = false;
  int line = 0;
};

// A TOML file as flat keys: "table.key", and "camera[1].name" for the second [[camera]].
struct TomlFile {
  std::filesystem::path path;
  std::map<std::string, TomlEntry> entries;

  // An InvalidInput error that begins with "FILE:LINE: ".
  tl::unexpected<Error> fault(const std::string& key, std::string_view problem, std::string_view why,
                              std::string_view suggestion) const;
};

// NotFound: no such file. InvalidInput: a fault of grammar, with its line; or a date, which we have no use
// for.
Result<TomlFile> read_toml(const std::filesystem::path& path);
// The same from memory; `path` is what errors call it.
Result<TomlFile> parse_toml(const std::string& text, const std::filesystem::path& path);

// A text between quotation marks, as TOML wants it.
std::string toml_text(std::string_view text);

}  // namespace flamefield
