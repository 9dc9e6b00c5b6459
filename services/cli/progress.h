#pragma once

#include <chrono>
#include <string>

namespace flamefield {

// Progress on stderr: a bar on a terminal, else a plain line every few seconds. Results go to stdout, so the
// two never mix.
class ProgressBar {
 public:
  explicit ProgressBar(std::string what);
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;

  // Cheap enough to be called often. `note` stands behind the bar.
  void update(double done, double total, const std::string& note = {});

 private:
  void draw(double fraction, const std::string& note);

  using Clock = std::chrono::steady_clock;
  std::string what_;
  bool is_terminal_;
  Clock::time_point started_ = Clock::now();
  Clock::time_point drawn_;
  bool has_drawn_ = false;
};

}  // namespace flamefield
