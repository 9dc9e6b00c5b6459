#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "calibrate/quality.h"
#include "proto/calibration.h"
#include "proto/message.h"
#include "services/bus/client.h"
#include "services/calibration/session.h"

namespace flamefield {

struct CalibrationServiceOptions {
  std::vector<std::string> cameras;
  std::vector<std::string> endpoints = {"inproc://calibration"};  // where sessions are asked for
  std::string acquisition_endpoint = "inproc://acquisition";
  std::string dispatcher_endpoint = "inproc://dispatcher";
  std::filesystem::path data_dir;  // of the ledger; reports go to `calibrations` in it
  // What a session uses unless it is told otherwise.
  BoardSpec board = {};
  Eigen::Vector3d reference_centre_mm{0, 0, 0};
  double reference_azimuth_rad = 0;
  MeasuringVolume volume = {};
  int threads = 0;                                   // of detection; 0: all cores
  std::chrono::milliseconds picture_patience{3000};  // then it says that no pictures come, and why
  // A simulated laboratory has to be told what a person sees: that the session has done with this pose.
  std::function<void()> show_next_pose = {};
};

// Guided calibration sessions over the bus, one at a time. While one runs, the cameras show and do not store;
// the pictures of each pose that is taken are stored as the sets of a board capture, which bears the
// session's name. Solutions are written as a report; accepting one makes it the ledger's newest calibration.
class CalibrationService {
 public:
  // Unavailable: an endpoint is in use.
  static Result<std::unique_ptr<CalibrationService>> open(Bus& bus, CalibrationServiceOptions options);

  Result<> run(std::stop_token stop);

  // Safe from any thread.
  CalibrationState state() const;
  std::string accepted_rig() const;  // fingerprint; empty: no session was accepted yet

 private:
  using Clock = std::chrono::steady_clock;
  CalibrationService(Bus& bus, CalibrationServiceOptions options);
  Message answer(const Message& question);
  Result<Message> on(const StartCalibration& request);
  Result<Message> on(const TakePose& request);
  Result<Message> on(const SolveCalibration& request);
  Result<Message> on(const AcceptCalibration& request);
  Result<Message> on(const DiscardCalibration& request);
  Result<Message> on(const GetCalibration& request);
  template <class Other>
  Result<Message> on(const Other&) {
    return invalid_input("a request to the calibration", "it is not one that it knows",
                         "ask another service");
  }

  void work(std::stop_token stop);
  void look_once();
  void take_pose(const FrameSet& set);
  void solve();
  Result<> write_report() const;
  Result<> store(FrameSet set);
  void ask_why_nothing_comes();
  Result<> close_capture();
  Result<> finish_capture();
  void close_left_behind();
  Result<Client> connect(const std::string& endpoint) const;
  std::optional<PreviousCalibration> newest_calibration() const;
  void publish();
  void say(std::string message);
  void fail(const Error& error);

  Bus& bus_;
  const CalibrationServiceOptions options_;
  std::unique_ptr<Router> router_;

  std::mutex work_mutex_;  // what follows: held while pictures are looked at, and for seconds while solving
  std::condition_variable_any changed_;
  std::optional<CalibrationSession> session_;
  std::optional<Client> array_;
  PutCapture capture_;
  std::int64_t last_pulse_ = 0, pulses_to_skip_ = 0;
  Clock::time_point last_news_{};
  bool is_starved_ = false;  // has said that no pictures come
  std::atomic<bool> wants_pose_ = false, wants_solution_ = false;

  mutable std::mutex state_mutex_;  // what follows
  CalibrationState state_;
  std::string accepted_rig_;
};

}  // namespace flamefield
