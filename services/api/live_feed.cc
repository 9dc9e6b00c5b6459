#include "services/api/live_feed.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <nlohmann/json.hpp>

#include "proto/utc.h"
#include "services/api/frame_messages.h"
#include "services/api/volume_messages.h"
#include "services/store/volume_file.h"
#include "services/worker/best_so_far.h"

namespace flamefield {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kLook{40}, kLookAtWork{200}, kLookUnwatched{250}, kTellAnyway{500}, kPatience{700};
constexpr int kThumbnail_px = 192;
constexpr std::int64_t kRateWindow_ns = 5'000'000'000;

}  // namespace

bool LiveFeed::has_new_watchers() {
  const std::uint64_t changes = board_.watch_changes();
  return std::exchange(watch_changes_, changes) != changes;
}

void LiveFeed::run(std::stop_token stop) {
  state_.report = report_link_;
  auto array = services_->connect_array();
  auto dispatcher = services_->connect_dispatcher();
  Every work(kLookAtWork), tell(kTellAnyway), disk(std::chrono::seconds(2));
  std::mutex mutex;
  std::condition_variable_any pause;
  while (!stop.stop_requested()) {
    const std::string before = state_.array ? concat(state_.array->id, state_.array->sets_stored) : "";
    if (array) look_at_array(*array);
    if (dispatcher && work.is_due()) look_at_dispatcher(*dispatcher);
    if (disk.is_due()) look_at_disk();
    state_.time_ns = utc_now_ns();
    const std::string now = state_.array ? concat(state_.array->id, state_.array->sets_stored) : "";
    const bool is_news = has_new_watchers();
    if (is_news) shown_set_.clear(), shown_run_.clear();
    if (array) show_frames(*array);
    if (is_news || before != now || tell.is_due()) board_.post("status", json_of(state_).dump(), false);
    show_volume();
    std::unique_lock lock(mutex);
    pause.wait_for(lock, stop, board_.is_watched("status") ? kLook : kLookUnwatched, [] { return false; });
  }
}

void LiveFeed::look_at_array(Client& array) {
  auto answer = array.ask_for<CaptureState>(GetCapture{}, kPatience);
  if (!answer) {  // while a capture drains, it may be busy for a moment
    if (++failures_ > 3) state_.array.reset();
    return;
  }
  failures_ = 0;
  const std::int64_t now = utc_now_ns();
  const bool is_same = state_.array && state_.array->id == answer->id;
  if (!is_same || answer->phase == CapturePhase::Idle) samples_.clear();
  samples_.push_back({now, answer->sets});
  while (now - samples_.front().time_ns > kRateWindow_ns) samples_.pop_front();
  const double seconds = 1e-9 * static_cast<double>(now - samples_.front().time_ns);
  state_.sets_per_s = seconds > 0.5 ? static_cast<double>(answer->sets - samples_.front().sets) / seconds : 0;
  state_.array = std::move(*answer);
}

void LiveFeed::look_at_dispatcher(Client& dispatcher) {
  auto answer = dispatcher.ask_for<Status>(GetStatus{}, kPatience);
  const bool has_news =
      !answer || !state_.dispatcher || answer->done != state_.dispatcher->done || state_.newest_run.empty();
  state_.dispatcher = answer ? std::optional(std::move(*answer)) : std::nullopt;
  if (!has_news) return;
  auto runs = RunList::open(services_->data_dir());
  if (!runs) return;
  const auto newest = runs->page({.limit = 1});
  if (!newest || newest->lines.empty()) return;
  RunLine shown = newest->lines.front();
  const std::string capture = state_.array ? state_.array->id : "";
  if (const auto page = runs->page({.capture = capture, .order = RunOrder::Capture, .limit = 1});
      page && !capture.empty()) {
    state_.volumes = page->total;
    // Sets that workers could not follow are made after newer ones: the flame does not go back for them.
    if (shown.capture == capture && !page->lines.empty()) shown = page->lines.front();
  }
  state_.newest_run = shown.id;
  volume_bytes_ = static_cast<double>(shown.volume_bytes);
}

void LiveFeed::look_at_disk() {
  std::error_code failed;
  const auto space = std::filesystem::space(services_->data_dir(), failed);
  state_.free_bytes = failed ? -1 : static_cast<double>(space.available);
  state_.bytes_per_set = frame_bytes_ + (state_.volumes > 0 ? volume_bytes_ : 0);
}

void LiveFeed::show_frames(Client& array) {
  if (!state_.array) return;
  const bool has_thumbnails = board_.is_watched("thumbnails");
  const auto full = board_.watched("frame:");
  const bool is_sized = frame_bytes_ > 0 || state_.array->sets == 0;
  if (!has_thumbnails && full.empty() && is_sized) return;
  const std::string set = concat(state_.array->id, "/", state_.array->sets);
  if (set == shown_set_) return;
  const auto data = array.ask_for<SetData>(GetPreview{}, kPatience);
  if (!data) return;
  shown_set_ = set;
  frame_bytes_ = 0;
  for (const Frame& frame : data->set.frames) {
    frame_bytes_ += frame.bytes ? static_cast<double>(frame.bytes->size()) : 0;
    const std::string topic = "frame:" + frame.camera;
    if (std::ranges::find(full, topic) == full.end()) continue;
    if (auto message = frame_message(data->set, frame)) board_.post(topic, std::move(*message), true);
  }
  if (has_thumbnails) board_.post("thumbnails", thumbnails_message(data->set, kThumbnail_px), true);
}

// An evolution renews its best field every few seconds; while there is one, it is what the page shows.
bool LiveFeed::show_best_so_far() {
  if (!best_look_.is_due()) return is_evolving_;
  const auto best = find_best_so_far(services_->data_dir());
  if (is_evolving_ && !best) shown_run_.clear();
  is_evolving_ = best.has_value();
  if (!best) return false;
  std::error_code failed;
  const auto written = std::filesystem::last_write_time(best->path, failed).time_since_epoch().count();
  const std::string name = concat(best->run_id, "@", written);
  if (failed || name == shown_run_) return true;
  const auto volume = read_volume(best->path);
  if (!volume) return true;  // renewed or removed just now
  shown_run_ = name;
  RunRow row;
  row.run.id = best->run_id;
  if (auto message = volume_message(*volume, row, 0, {})) board_.post("volume", std::move(*message), true);
  return true;
}

void LiveFeed::show_volume() {
  if (board_.is_watched("volume") && show_best_so_far()) return;
  if (state_.newest_run.empty() || state_.newest_run == shown_run_ || !board_.is_watched("volume")) return;
  shown_run_ = state_.newest_run;  // also when it cannot be shown: once is enough
  auto ledger = services_->ledger();
  auto runs = RunList::open(services_->data_dir());
  if (!ledger || !runs) return;
  const auto run = ledger->run(state_.newest_run);
  if (!run || run->run.inputs.empty()) return;
  const auto volume = read_volume(services_->data_dir() / run->run.volume_path);
  if (!volume) return;
  const SetId& first = run->run.inputs.front();
  const auto pulse_time_ns = runs->pulse_time_ns(first.capture, first.index);
  if (auto message = volume_message(*volume, *run, pulse_time_ns ? *pulse_time_ns : 0, {}))
    board_.post("volume", std::move(*message), true);
}

}  // namespace flamefield
