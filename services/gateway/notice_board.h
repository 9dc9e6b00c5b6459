#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace flamefield {

// The newest of everything that pages watch: each topic holds one message, and a new one replaces it. Who
// reads too slowly misses messages in between and never an end state; memory is one message a topic. Any
// thread.
class NoticeBoard {
 public:
  struct Note {
    std::uint64_t version = 0;  // grows with every post on the board
    bool binary = false;
    std::shared_ptr<const std::string> bytes;
  };

  void post(const std::string& topic, std::string bytes, bool binary);
  std::optional<Note> newest(const std::string& topic) const;
  // Waits for a first one; none: not within the time.
  std::optional<Note> wait_for(const std::string& topic, std::chrono::milliseconds patience) const;

  // Watchers are counted, so that nobody makes what nobody looks at.
  void watch(const std::string& topic);
  void unwatch(const std::string& topic);
  bool is_watched(const std::string& topic) const;
  std::vector<std::string> watched(std::string_view prefix) const;
  std::uint64_t watch_changes() const;  // grows with every watch()

  // Called after each post by the thread that posted; set it before anybody posts.
  void on_post(std::function<void()> listener) { listener_ = std::move(listener); }

 private:
  std::optional<Note> find(const std::string& topic) const;  // mutex_ is held

  mutable std::mutex mutex_;
  mutable std::condition_variable posted_;
  std::map<std::string, Note, std::less<>> notes_;
  std::map<std::string, int, std::less<>> watchers_;
  std::uint64_t version_ = 0, watch_changes_ = 0;
  std::function<void()> listener_;
};

// A binary message: "FFW1", the header's length in bytes (uint32, little-endian), the header as JSON padded
// with blanks so that the payload begins at a multiple of 8, then the payload. The README of this folder
// lists the headers.
std::string framed(std::string_view json_header, std::string_view payload);

}  // namespace flamefield
