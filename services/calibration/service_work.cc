// What a calibration session does between questions: it looks at the newest pictures, takes poses, solves.
#include <thread>
#include <utility>

#include "services/calibration/output.h"
#include "services/calibration/service.h"
#include "services/store/rig_file.h"

namespace flamefield {

namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// Previews hold the newest frame of every camera: a camera that lost this pulse shows an earlier one, with
// the board perhaps elsewhere, and before the first pulse there may be pictures of an earlier capture.
void keep_newest_pulse(FrameSet& set, std::int64_t since_ns) {
  std::erase_if(set.frames, [&](const Frame& frame) {
    return frame.pulse != set.pulse || frame.arrival_time_ns < since_ns;
  });
}

}  // namespace

void CalibrationService::work(std::stop_token stop) {
  constexpr milliseconds kBreath{2};  // for requests that wait for the session
  while (!stop.stop_requested()) {
    std::this_thread::sleep_for(kBreath);
    std::unique_lock lock(work_mutex_);
    const auto is_busy = [this] {
      return session_ && (wants_solution_ || state().phase == CalibrationPhase::Detecting);
    };
    if (!changed_.wait_for(lock, stop, milliseconds(200), is_busy)) continue;
    if (wants_solution_.exchange(false)) {
      solve();
    } else {
      look_once();
    }
    publish();
  }
}

void CalibrationService::look_once() {
  constexpr milliseconds kBetweenLooks{30};
  auto newest = array_->ask_for<SetData>(GetPreview{""}, seconds(5));
  if (newest) keep_newest_pulse(newest->set, capture_.started_time_ns);
  if (!newest || newest->set.frames.empty() || newest->set.pulse <= last_pulse_ + pulses_to_skip_) {
    if (!newest && newest.error().code != ErrorCode::NotFound) fail(newest.error());
    ask_why_nothing_comes();
    changed_.wait_for(work_mutex_, kBetweenLooks, [] { return false; });
    return;
  }
  if (std::exchange(is_starved_, false)) say("pictures come again");
  last_news_ = Clock::now();
  last_pulse_ = newest->set.pulse;
  pulses_to_skip_ = 0;
  if (auto ok = session_->look(newest->set); !ok) return fail(ok.error());
  const bool is_automatic = state().automatic;
  if (wants_pose_.exchange(false) || (is_automatic && session_->is_worth_taking()))
    return take_pose(newest->set);
  if (is_automatic && session_->is_useless() && options_.show_next_pose) {
    options_.show_next_pose();
    pulses_to_skip_ = 1;  // it may have been exposed before
  }
}

// Someone may have stopped the array, or its trigger: a person who waits for the board to be found should
// know.
void CalibrationService::ask_why_nothing_comes() {
  if (Clock::now() - last_news_ < options_.picture_patience) return;
  last_news_ = Clock::now();
  const auto array = array_->ask_for<CaptureState>(GetCapture{}, seconds(5));
  if (!array) return fail(array.error());
  const bool is_ours = is_capturing(array->phase) && array->id == capture_.id;
  is_starved_ = true;
  fail(unavailable("no new pictures",
                   is_ours ? "the cameras wait for a trigger" : "somebody stopped the array",
                   is_ours ? "switch the trigger on" : "discard the session and start another one")
           .value());
}

void CalibrationService::take_pose(const FrameSet& set) {
  const auto name = session_->take();
  if (!name) return fail(name.error());
  if (auto ok = store(set); !ok) return fail(ok.error());
  if (options_.show_next_pose) {
    options_.show_next_pose();
    pulses_to_skip_ = 1;
  }
  say(concat(*name, " taken"));
  session_->solve_roughly();
  const std::scoped_lock lock(state_mutex_);
  state_.report.clear();  // of fewer poses
}

void CalibrationService::solve() {
  const auto solved = session_->solve();
  if (!solved) {
    fail(solved.error());
    const std::scoped_lock lock(state_mutex_);
    state_.phase = CalibrationPhase::Detecting;
    return;
  }
  const Result<> written = write_report();
  if (!written) fail(written.error());
  publish();  // who sees that it is solved sees the solution
  const std::scoped_lock lock(state_mutex_);
  state_.phase = CalibrationPhase::Solved;
  state_.message = concat("solved from ", session_->poses(), " poses");
  if (written) state_.report = concat("calibrations/", capture_.id, "/report.html");
}

Result<> CalibrationService::write_report() const {
  const auto folder = options_.data_dir / "calibrations" / capture_.id;
  std::error_code ignored;  // writing says it better
  std::filesystem::create_directories(folder, ignored);
  const auto& previous = session_->options().previous;
  if (auto ok = write_rig(folder / "rig.yaml", session_->report()->rig); !ok) return ok;
  return write_calibration_report(
      folder, *session_->report(),
      {.board = session_->options().board,
       .command_line = "flamefield calibrate session",
       .comparison = session_->comparison(),
       .compared_with = previous ? concat("calibration ", previous->version) : ""});
}

}  // namespace flamefield
