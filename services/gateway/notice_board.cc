#include "services/gateway/notice_board.h"

namespace flamefield {

void NoticeBoard::post(const std::string& topic, std::string bytes, bool binary) {
  auto shared = std::make_shared<const std::string>(std::move(bytes));
  {
    const std::scoped_lock lock(mutex_);
    notes_[topic] = {++version_, binary, std::move(shared)};
  }
  posted_.notify_all();
  if (listener_) listener_();
}

std::optional<NoticeBoard::Note> NoticeBoard::find(const std::string& topic) const {
  const auto found = notes_.find(topic);
  return found == notes_.end() ? std::nullopt : std::optional(found->second);
}

std::optional<NoticeBoard::Note> NoticeBoard::newest(const std::string& topic) const {
  const std::scoped_lock lock(mutex_);
  return find(topic);
}

std::optional<NoticeBoard::Note> NoticeBoard::wait_for(const std::string& topic,
                                                       std::chrono::milliseconds patience) const {
  std::unique_lock lock(mutex_);
  posted_.wait_for(lock, patience, [&] { return notes_.contains(topic); });
  return find(topic);
}

void NoticeBoard::watch(const std::string& topic) {
  const std::scoped_lock lock(mutex_);
  ++watchers_[topic];
  ++watch_changes_;
}

void NoticeBoard::unwatch(const std::string& topic) {
  const std::scoped_lock lock(mutex_);
  const auto found = watchers_.find(topic);
  if (found == watchers_.end() || --found->second > 0) return;
  watchers_.erase(found);
  notes_.erase(topic);  // the next to watch shall not be shown what is old by then
}

bool NoticeBoard::is_watched(const std::string& topic) const {
  const std::scoped_lock lock(mutex_);
  return watchers_.contains(topic);
}

std::vector<std::string> NoticeBoard::watched(std::string_view prefix) const {
  const std::scoped_lock lock(mutex_);
  std::vector<std::string> topics;
  for (auto at = watchers_.lower_bound(prefix); at != watchers_.end() && at->first.starts_with(prefix); ++at)
    topics.push_back(at->first);
  return topics;
}

std::uint64_t NoticeBoard::watch_changes() const {
  const std::scoped_lock lock(mutex_);
  return watch_changes_;
}

std::string framed(std::string_view json_header, std::string_view payload) {
  constexpr std::size_t kPrefix = 8;
  const std::size_t padded = (kPrefix + json_header.size() + 7) / 8 * 8 - kPrefix;
  std::string out = "FFW1";
  for (int byte = 0; byte < 4; ++byte) out += static_cast<char>(padded >> (8 * byte) & 0xff);
  out.reserve(kPrefix + padded + payload.size());
  out += json_header;
  out.append(padded - json_header.size(), ' ');
  out += payload;
  return out;
}

}  // namespace flamefield
