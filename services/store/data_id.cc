#include "services/store/data_id.h"

#include <array>
#include <cstdio>
#include <random>

#include "services/store/file.h"

namespace flamefield {

namespace {

std::filesystem::path file_of(const std::filesystem::path& data_dir) {
  return data_dir / "volumes" / ".data-id";
}

}  // namespace

Result<std::string> make_data_id(const std::filesystem::path& data_dir) {
  const std::string known = read_data_id(data_dir);
  if (known != kNoDataId) return known;
  std::random_device random;
  std::array<char, 33> id{};
  std::snprintf(id.data(), id.size(), "%08x%08x%08x%08x", random(), random(), random(), random());
  if (auto ok = write_text_file(file_of(data_dir), id.data()); !ok) return tl::unexpected(ok.error());
  return std::string(id.data());
}

std::string read_data_id(const std::filesystem::path& data_dir) {
  const auto text = read_text_file(file_of(data_dir), 64);
  return text && !text->empty() ? *text : std::string(kNoDataId);
}

}  // namespace flamefield
