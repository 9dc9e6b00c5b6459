#pragma once

#include <chrono>
#include <deque>
#include <memory>
#include <stop_token>
#include <string>

#include "services/api/lab_state.h"
#include "services/api/live_services.h"
#include "services/gateway/notice_board.h"
#include "services/ledger/run_list.h"

namespace flamefield {

// Due once in each period.
class Every {
 public:
  explicit Every(std::chrono::milliseconds period) : period_(period) {}
  bool is_due() {
    const auto now = std::chrono::steady_clock::now();
    if (now < next_) return false;
    next_ = now + period_;
    return true;
  }

 private:
  std::chrono::milliseconds period_;
  std::chrono::steady_clock::time_point next_{};
};

// Puts what the live page watches on the board: topics "status", "thumbnails", "frame:CAMERA" and "volume".
// Asks the services as long as anybody watches; what nobody watches is not made. One thread, in run().
class LiveFeed {
 public:
  LiveFeed(std::shared_ptr<LiveServices> services, NoticeBoard& board, std::string report_link)
      : services_(std::move(services)), board_(board), report_link_(std::move(report_link)) {}

  void run(std::stop_token stop);

 private:
  void look_at_array(Client& array);
  void look_at_dispatcher(Client& dispatcher);
  void look_at_disk();
  void show_frames(Client& array);
  void show_volume();
  bool show_best_so_far();
  bool has_new_watchers();

  const std::shared_ptr<LiveServices> services_;
  NoticeBoard& board_;
  const std::string report_link_;
  LabState state_;
  std::string shown_set_, shown_run_;  // what is on the board
  std::uint64_t watch_changes_ = 0;
  double frame_bytes_ = 0, volume_bytes_ = 0;  // of the newest set
  bool is_evolving_ = false;
  Every best_look_{std::chrono::seconds(1)};
  int failures_ = 0;  // of the array's answers, in a row
  struct Sample {
    std::int64_t time_ns = 0, sets = 0;
  };
  std::deque<Sample> samples_;  // of the running capture, the last seconds
};

}  // namespace flamefield
