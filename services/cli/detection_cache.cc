#include "services/cli/detection_cache.h"

#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>

#include "proto/version.h"
#include "services/store/file.h"

namespace flamefield {

namespace {

constexpr const char* kFormat = "flamefield-detections-1";

// FNV-1a over size, board and grey levels; the program's version, as detectors change.
std::string key_of(const BoardView& view, const BoardSpec& board) {
  std::uint64_t hash = 14695981039346656037u;
  const auto add = [&](const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) hash = (hash ^ bytes[i]) * 1099511628211u;
  };
  add(view.image.pixels.data(), view.image.pixels.size() * sizeof(float));
  return concat(program_version(), ' ', name_of(board.kind), ' ', board.cols, 'x', board.rows, ' ',
                board.dictionary, board.dictionary.empty() ? 0 : board.marker_mm / board.square_mm, ' ',
                view.image.width_px, 'x', view.image.height_px, ' ', hash);
}

}  // namespace

DetectionCache DetectionCache::read(const std::filesystem::path& path) {
  DetectionCache cache;
  const auto text = read_text_file(path);
  if (!text) return cache;
  const auto json = nlohmann::json::parse(*text, nullptr, false);
  if (!json.is_object() || json.value("format", "") != kFormat) return cache;
  try {
    for (const auto& [key, value] : json.at("pictures").items()) {
      Entry entry{{}, value.at("reason").get<std::string>()};
      const auto& numbers = value.at("corners_px");
      const auto number = [&](std::size_t i) {  // JSON has null for what is not a number
        return numbers[i].is_null() ? std::numeric_limits<double>::quiet_NaN() : numbers[i].get<double>();
      };
      for (std::size_t i = 0; i + 1 < numbers.size(); i += 2)
        entry.corners_px.emplace_back(number(i), number(i + 1));
      cache.entries_[key] = std::move(entry);
    }
  } catch (const nlohmann::json::exception&) {
    return {};
  }
  return cache;
}

Result<> DetectionCache::write(const std::filesystem::path& path) const {
  nlohmann::json pictures = nlohmann::json::object();
  for (const auto& [key, entry] : entries_) {
    nlohmann::json numbers = nlohmann::json::array();
    for (const Eigen::Vector2d& p : entry.corners_px) {
      numbers.push_back(p.x());
      numbers.push_back(p.y());
    }
    pictures[key] = {{"reason", entry.reason}, {"corners_px", numbers}};
  }
  return write_text_file(path, nlohmann::json{{"format", kFormat}, {"pictures", pictures}}.dump() + "\n");
}

Result<std::vector<Detection>> DetectionCache::detect(std::span<const BoardView> views,
                                                      const BoardSpec& board, const DetectOptions& options) {
  std::vector<std::string> keys;
  std::vector<BoardView> unknown;
  for (const BoardView& view : views) {
    keys.push_back(key_of(view, board));
    if (!entries_.contains(keys.back())) unknown.push_back(view);
  }
  auto found = flamefield::detect(unknown, board, options);
  if (!found) return found;
  for (std::size_t i = 0; i < unknown.size(); ++i)
    entries_[key_of(unknown[i], board)] = {(*found)[i].corners_px, (*found)[i].reason};
  std::vector<Detection> all;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Entry& entry = entries_.at(keys[i]);
    all.push_back({views[i].camera, views[i].pose, views[i].image.width_px, views[i].image.height_px,
                   entry.corners_px, entry.reason});
  }
  return all;
}

}  // namespace flamefield
