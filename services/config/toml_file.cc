#include "services/config/toml_file.h"

#include <optional>
#include <sstream>
#include <toml.hpp>

#include "services/store/file.h"

namespace flamefield {

namespace {

constexpr std::uint64_t kMaxBytes = 1u << 20;

std::string at_line(const std::filesystem::path& path, int line) {
  return concat(path.string(), ":", line, ": ");
}

int line_of(const toml::value& value) {
  return static_cast<int>(value.location().line());
}

std::optional<Setting> scalar(const toml::value& value) {
  if (value.is_boolean()) return value.as_boolean();
  if (value.is_integer()) return static_cast<std::int64_t>(value.as_integer());
  if (value.is_floating()) return value.as_floating();
  if (value.is_string()) return value.as_string().str;
  return std::nullopt;
}

Result<> flatten(const toml::value& value, const std::string& name, TomlFile& file);

Result<> flatten_list(const toml::value& value, const std::string& name, TomlFile& file) {
  TomlEntry entry{{}, true, line_of(value)};
  std::size_t index = 0;
  for (const toml::value& element : value.as_array()) {
    if (element.is_table()) {
      if (auto ok = flatten(element, concat(name, "[", index++, "]"), file); !ok) return ok;
    } else if (auto setting = scalar(element)) {
      entry.values.push_back(*setting);
    } else {
      return invalid_input(concat(at_line(file.path, entry.line), name), "a list within a list or a date",
                           "use numbers, texts, true and false");
    }
  }
  if (index == 0) file.entries[name] = std::move(entry);
  return {};
}

Result<> flatten(const toml::value& value, const std::string& name, TomlFile& file) {
  if (value.is_table()) {
    for (const auto& [key, child] : value.as_table()) {
      if (auto ok = flatten(child, name.empty() ? key : concat(name, ".", key), file); !ok) return ok;
    }
    return {};
  }
  if (value.is_array()) return flatten_list(value, name, file);
  auto setting = scalar(value);
  if (!setting) {
    return invalid_input(concat(at_line(file.path, line_of(value)), name), "a date where none is expected",
                         "use a number, a text, true or false");
  }
  file.entries[name] = TomlEntry{{*setting}, false, line_of(value)};
  return {};
}

// "[error] toml::parse_table: invalid line format\n --> ..." without the library's own names.
std::string first_line(std::string text) {
  text = text.substr(0, text.find('\n'));
  if (const auto colons = text.find(": "); text.starts_with("[error] toml::") && colons != std::string::npos)
    text = text.substr(colons + 2);
  return text;
}

}  // namespace

tl::unexpected<Error> TomlFile::fault(const std::string& key, std::string_view problem, std::string_view why,
                                      std::string_view suggestion) const {
  const auto entry = entries.find(key);
  const std::string where = entry == entries.end() ? path.string() + ": " : at_line(path, entry->second.line);
  return invalid_input(where + std::string(problem), why, suggestion);
}

Result<TomlFile> read_toml(const std::filesystem::path& path) {
  auto text = read_text_file(path, kMaxBytes);
  if (!text) return tl::unexpected(text.error());
  return parse_toml(*text, path);
}

Result<TomlFile> parse_toml(const std::string& text, const std::filesystem::path& path) {
  TomlFile file{path, {}};
  try {
    std::istringstream stream(text);
    const toml::value root = toml::parse(stream, path.string());
    if (auto ok = flatten(root, "", file); !ok) return tl::unexpected(ok.error());
    return file;
  } catch (const toml::exception& exception) {
    return invalid_input(
        concat(at_line(path, static_cast<int>(exception.location().line())), "not valid TOML"),
        first_line(exception.what()), "mend the line");
  } catch (const std::exception& exception) {
    return invalid_input(concat(path.string(), ": not valid TOML"), first_line(exception.what()),
                         "mend the file");
  }
}

std::string toml_text(std::string_view text) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string out = "\"";
  for (char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += {'\\', c};
    } else if (code < 32 || code == 127) {
      out += concat("\\u00", kDigits[code >> 4], kDigits[code & 15]);
    } else {
      out += c;
    }
  }
  return out + '"';
}

}  // namespace flamefield
