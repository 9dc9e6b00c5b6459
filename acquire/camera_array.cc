#include "acquire/camera_array.h"

#include <algorithm>
#include <chrono>

#include "acquire/discovery.h"
#include "proto/check.h"
#include "proto/utc.h"

namespace flamefield {

namespace {

constexpr int kArmingTries = 20;

// UTC at the first call, then the steady clock: a correction of the system's time must not close sets.
std::int64_t steady_utc_ns() {
  using std::chrono::steady_clock;
  static const auto begin = steady_clock::now();
  static const std::int64_t begin_utc_ns = utc_now_ns();
  return begin_utc_ns + std::chrono::nanoseconds(steady_clock::now() - begin).count();
}

// Asks all cameras at once, then waits for all answers; the messages of those that failed, joined.
template <class Ask>
Result<> ask_all(const std::vector<std::unique_ptr<GigeCamera>>& cameras, Ask ask) {
  std::vector<std::future<Result<>>> answers;
  for (const auto& camera : cameras) answers.push_back(ask(*camera));
  std::optional<Error> error;
  for (auto& answer : answers) {
    const Result<> result = answer.get();
    if (result) continue;
    if (error) {
      error->message += "; " + result.error().message;
    } else {
      error = result.error();
    }
  }
  if (error) return tl::unexpected(*error);
  return {};
}

}  // namespace

Result<std::unique_ptr<CameraArray>> CameraArray::open(const std::vector<CameraAddress>& addresses,
                                                       const CameraSettings& settings) {
  if (addresses.empty())
    return invalid_input("no cameras", "an array needs at least one", "list their addresses");
  for (std::size_t i = 0; i < addresses.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const bool is_twice = addresses[i].name == addresses[k].name ||
                            (!addresses[i].address.empty() && addresses[i].address == addresses[k].address);
      if (!is_twice) continue;
      return invalid_input(concat("camera ", addresses[i].name, " at ", addresses[i].address),
                           "its name or address is used twice", "give each camera its own");
    }
  }
  if (auto ok = validate(settings); !ok) return tl::unexpected(ok.error());
  auto resolved = resolve_addresses(addresses);
  if (!resolved) return tl::unexpected(resolved.error());
  std::unique_ptr<CameraArray> array(new CameraArray);
  for (const CameraAddress& address : *resolved) {
    array->cameras_.push_back(std::make_unique<GigeCamera>(address, settings));
  }
  if (auto ok = ask_all(array->cameras_, [](GigeCamera& camera) { return camera.open(); }); !ok) {
    return tl::unexpected(ok.error());
  }
  return array;
}

CameraArray::~CameraArray() {
  if (is_capturing_) stop();
  for (const auto& camera : cameras_) camera->begin_close();  // each may take seconds, all at the same time
  cameras_.clear();  // until then their threads push into what would be destroyed before them
}

Result<> CameraArray::apply(const CameraSettings& settings) {
  expect(!is_capturing_, "settings change between captures");
  if (auto ok = validate(settings); !ok) return ok;
  return ask_all(cameras_, [&](GigeCamera& camera) { return camera.apply(settings); });
}

GigeCamera::Events CameraArray::events_of(std::size_t camera) {
  return {.on_frame =
              [this, camera](Arrival arrival) {
                push({camera, std::move(arrival)});
              },
          .on_loss =
              [this, camera](LossCause cause) {
                push({camera, cause});
              },
          .on_camera_lost =
              [this, camera] {
                push({camera, Lost{}});
              },
          .on_answer =
              [this, camera](bool is_alive) {
                if (is_alive) {
                  push({camera, Alive{}});
                } else {
                  push({camera, Lost{}});
                }
              },
          .on_rejoin =
              [this, camera] {
                push({camera, Rejoined{}});
              }};
}

Result<> CameraArray::start(const CaptureOptions& options, SetHandler on_set) {
  expect(!is_capturing_, "one capture at a time");
  expect(options.set_deadline_ms > 0 && options.pulses >= 0,
         "the deadline is positive, pulses are not negative");
  std::size_t number = 0;
  Result<> armed = ask_all(cameras_, [&](GigeCamera& camera) { return camera.arm(events_of(number++)); });
  {
    const std::lock_guard lock(mutex_);
    inputs_.clear();  // what a camera that was given up delivered after the last capture
  }
  Result<std::int64_t> count = armed ? agree_on_count() : tl::unexpected(armed.error());
  if (!count) {
    for (const auto& camera : cameras_) camera->stop();  // the answers do not matter
    return tl::unexpected(count.error());
  }
  first_count_ = *count;
  GrouperOptions grouper;
  grouper.cameras = names();
  grouper.capture = options.capture;
  grouper.kind = options.kind;
  grouper.pulses = options.pulses;
  grouper.first_count = first_count_;
  grouper.deadline_ns = options.set_deadline_ms * 1'000'000;
  options_ = options;
  on_set_ = std::move(on_set);
  {
    const std::lock_guard lock(mutex_);
    grouper_.emplace(std::move(grouper));
    is_looked_for_.assign(cameras_.size(), false);
    rejoins_.assign(cameras_.size(), 0);
    sets_handled_ = complete_sets_ = 0;
    end_request_.reset();
    flush_request_ = is_drained_ = false;
  }
  is_capturing_ = true;
  thread_ = std::thread([this] { run(); });
  return {};
}

// All cameras must agree which pulse is the first, even if the trigger never stops: when all counters read
// zero after all have been reset, no edge came in between, so they count together from here on.
Result<std::int64_t> CameraArray::agree_on_count() {
  bool agreed = false;
  for (int i = 0; i < kArmingTries && !agreed; ++i) {
    std::vector<std::future<bool>> resets;
    for (const auto& camera : cameras_) resets.push_back(camera->reset_trigger_count());
    bool any = false;
    for (auto& reset : resets) any = reset.get() || any;
    const auto counts = trigger_counts();
    agreed =
        !any || std::all_of(counts.begin(), counts.end(), [](const auto& c) { return c.value_or(0) == 0; });
  }
  if (!agreed) {
    return unavailable("cannot arm the cameras", "trigger pulses came during each of 20 tries",
                       "pause the trigger while arming");
  }
  if (auto ok = ask_all(cameras_, [](GigeCamera& camera) { return camera.start(); }); !ok) {
    return tl::unexpected(ok.error());
  }
  return 0;
}

// Of every camera that is there and counts.
std::vector<std::optional<std::int64_t>> CameraArray::trigger_counts() {
  std::vector<std::optional<std::future<std::optional<std::int64_t>>>> answers;
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    const bool is_lost = [&] {
      const std::lock_guard lock(mutex_);
      return is_capturing_ && grouper_->is_lost(i);
    }();
    answers.push_back(is_lost ? std::nullopt : std::optional(cameras_[i]->trigger_count()));
  }
  std::vector<std::optional<std::int64_t>> counts;
  for (auto& answer : answers) counts.push_back(answer ? answer->get() : std::nullopt);
  return counts;
}

// The latest pulse that the cameras have counted; none when no camera counts. A counter that took noise for
// an edge is ahead of all others: of three or more, two must have seen the pulse.
std::optional<std::int64_t> CameraArray::last_fired_pulse() {
  const auto counts = trigger_counts();
  const std::lock_guard lock(mutex_);
  std::vector<std::int64_t> pulses;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (!counts[i]) continue;
    if (const auto pulse = grouper_->pulse_of_count(i, *counts[i])) pulses.push_back(*pulse);
  }
  if (pulses.empty()) return std::nullopt;
  std::sort(pulses.rbegin(), pulses.rend());
  return pulses[pulses.size() > 2 ? 1 : 0];
}

// With the lock held: probes cameras that owe a frame, and looks for those that are lost.
void CameraArray::look_after_silent_cameras() {
  for (std::size_t camera : grouper_->take_overdue(steady_utc_ns())) cameras_[camera]->probe();
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    const bool is_lost = grouper_->is_lost(i);
    if (is_lost && !is_looked_for_[i]) cameras_[i]->recover();
    is_looked_for_[i] = is_lost;
  }
}

void CameraArray::push(Input input) {
  {
    const std::lock_guard lock(mutex_);
    inputs_.push_back(std::move(input));
  }
  wake_.notify_all();
}

void CameraArray::feed(Input input, std::vector<FrameSet>& sets) {
  const std::int64_t now_ns = steady_utc_ns();
  std::vector<FrameSet> more;
  if (auto* arrival = std::get_if<Arrival>(&input.what)) {
    more = grouper_->add(input.camera, std::move(*arrival), now_ns);
  } else if (const auto* cause = std::get_if<LossCause>(&input.what)) {
    more = grouper_->lose(input.camera, *cause, now_ns);
  } else if (std::holds_alternative<Lost>(input.what)) {
    more = grouper_->lose_camera(input.camera, now_ns);
  } else if (std::holds_alternative<Alive>(input.what)) {
    grouper_->answered(input.camera);
  } else {
    grouper_->rejoin(input.camera);
    ++rejoins_[input.camera];
  }
  std::move(more.begin(), more.end(), std::back_inserter(sets));
}

void CameraArray::run() {
  std::unique_lock lock(mutex_);
  for (bool is_over = false; !is_over;) {
    const auto has_news = [this] {
      return !inputs_.empty() || flush_request_ ||
             (end_request_ && !is_drained_ && !grouper_->has_open_sets());
    };
    if (const auto deadline_ns = grouper_->next_deadline_ns()) {
      const std::int64_t wait_ns = std::max<std::int64_t>(*deadline_ns - steady_utc_ns(), 0);
      wake_.wait_for(lock, std::chrono::nanoseconds(wait_ns), has_news);
    } else {
      wake_.wait(lock, has_news);
    }
    std::vector<FrameSet> sets;
    const auto collect = [&sets](std::vector<FrameSet> more) {
      std::move(more.begin(), more.end(), std::back_inserter(sets));
    };
    for (; !inputs_.empty(); inputs_.pop_front()) feed(std::move(inputs_.front()), sets);
    if (end_request_) collect(grouper_->end_at(*end_request_, steady_utc_ns()));
    collect(grouper_->advance(steady_utc_ns()));
    look_after_silent_cameras();
    if (flush_request_) {
      collect(grouper_->flush(steady_utc_ns()));
      is_over = true;
    }
    lock.unlock();
    std::int64_t complete = 0;
    const auto handled = static_cast<std::int64_t>(sets.size());
    for (FrameSet& set : sets) {
      complete += set.losses.empty() ? 1 : 0;
      on_set_(std::move(set));
    }
    lock.lock();
    sets_handled_ += handled;
    complete_sets_ += complete;
    is_drained_ = is_over || (end_request_ && inputs_.empty() && !grouper_->has_open_sets());
    changed_.notify_all();
  }
}

bool CameraArray::wait_done(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, timeout,
                           [this] { return options_.pulses > 0 && sets_handled_ >= options_.pulses; });
}

CaptureReport CameraArray::stop() {
  expect(is_capturing_, "a capture is under way");
  if (const auto last = last_fired_pulse()) {
    std::unique_lock lock(mutex_);
    end_request_ = *last;
    wake_.notify_all();
    changed_.wait(lock, [this] { return is_drained_; });  // at the latest at the last set's deadline
  }
  CaptureReport report;
  report.capture = options_.capture;
  report.kind = options_.kind;
  std::vector<std::future<StreamStatistics>> statistics;
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    CameraReceipt receipt;
    receipt.camera = cameras_[i]->name();
    {
      const std::lock_guard lock(mutex_);
      receipt.is_lost = grouper_->is_lost(i);
    }
    statistics.push_back(cameras_[i]->stop(!receipt.is_lost));
    report.cameras.push_back(std::move(receipt));
  }
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    // A lost camera takes seconds to let go; nothing waits for it but its own thread.
    if (!report.cameras[i].is_lost) report.cameras[i].stream = statistics[i].get();
  }
  {
    const std::lock_guard lock(mutex_);
    flush_request_ = true;
  }
  wake_.notify_all();
  thread_.join();
  is_capturing_ = false;
  const std::lock_guard lock(mutex_);
  report.pulses = grouper_->pulses_seen();
  report.complete_sets = complete_sets_;
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    report.cameras[i].tally = grouper_->tallies()[i];
    report.cameras[i].rejoins = rejoins_[i];
    report.cameras[i].drift_ppm = grouper_->drift_ppm(i);
  }
  return report;
}

Result<> CameraArray::software_trigger() {
  return ask_all(cameras_, [](GigeCamera& camera) { return camera.software_trigger(); });
}

CaptureProgress CameraArray::progress() const {
  const std::lock_guard lock(mutex_);
  CaptureProgress out;
  if (!grouper_) return out;
  out.pulses_seen = grouper_->pulses_seen();
  out.sets = sets_handled_;
  out.complete_sets = complete_sets_;
  out.tallies = grouper_->tallies();
  out.rejoins = rejoins_;
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    out.problems.push_back(cameras_[i]->problem());
    if (grouper_->is_lost(i)) out.lost_cameras.push_back(cameras_[i]->name());
  }
  return out;
}

Result<BandwidthPlan> CameraArray::share_link(BandwidthNeeds needs) {
  expect(!is_capturing_, "the link is shared out between captures");
  std::vector<std::future<Result<FrameShape>>> shapes;
  for (const auto& camera : cameras_) shapes.push_back(camera->shape());
  needs.cameras = cameras_.size();
  needs.payload_bytes = 0;
  for (auto& answer : shapes) {
    const auto shape = answer.get();
    if (!shape) return tl::unexpected(shape.error());
    if (shape->payload_bytes <= needs.payload_bytes) continue;  // the largest frame sets the places
    needs.payload_bytes = shape->payload_bytes;
    needs.width_px = shape->width_px;
    needs.height_px = shape->height_px;
  }
  auto plan = plan_bandwidth(needs);
  if (!plan) return plan;
  std::size_t number = 0;
  const Result<> set = ask_all(
      cameras_, [&](GigeCamera& camera) { return camera.set_frame_delay(plan->frame_delay_ns[number++]); });
  if (!set) return tl::unexpected(set.error());
  return plan;
}

std::optional<SharedClock> CameraArray::common_clock() {
  std::vector<std::future<std::optional<SharedClock>>> answers;
  for (const auto& camera : cameras_) answers.push_back(camera->shared_clock());
  std::vector<SharedClock> clocks;
  for (auto& answer : answers) {
    if (const auto clock = answer.get()) clocks.push_back(*clock);
  }
  return clocks.size() == cameras_.size() ? agreed_clock(std::move(clocks)) : std::nullopt;
}

std::vector<std::string> CameraArray::addresses() const {
  std::vector<std::string> out;
  for (const auto& camera : cameras_) out.push_back(camera->address());
  return out;
}

std::vector<std::string> CameraArray::names() const {
  std::vector<std::string> out;
  for (const auto& camera : cameras_) out.push_back(camera->name());
  return out;
}

}  // namespace flamefield
