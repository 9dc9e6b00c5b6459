#include "services/cli/progress.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace flamefield {

namespace {

constexpr int kBarWidth = 30;
constexpr std::chrono::milliseconds kTerminalPeriod{100};
constexpr std::chrono::milliseconds kPlainPeriod{5000};

}  // namespace

ProgressBar::ProgressBar(std::string what)
    : what_(std::move(what)), is_terminal_(::isatty(STDERR_FILENO) == 1), drawn_(started_) {}

ProgressBar::~ProgressBar() {
  if (is_terminal_ && has_drawn_) std::fputs("\r\033[K", stderr);
}

void ProgressBar::update(double done, double total, const std::string& note) {
  const auto now = Clock::now();
  const bool is_due = now - drawn_ >= (is_terminal_ ? kTerminalPeriod : kPlainPeriod);
  if (!is_due) return;
  drawn_ = now;
  has_drawn_ = true;
  draw(total > 0 ? std::clamp(done / total, 0.0, 1.0) : 0.0, note);
}

void ProgressBar::draw(double fraction, const std::string& note) {
  const int percent = static_cast<int>(std::lround(100 * fraction));
  if (!is_terminal_) {
    std::fprintf(stderr, "%s %d %% %s\n", what_.c_str(), percent, note.c_str());
    return;
  }
  const int filled = static_cast<int>(std::lround(kBarWidth * fraction));
  const std::string bar = std::string(static_cast<std::size_t>(filled), '#') +
                          std::string(static_cast<std::size_t>(kBarWidth - filled), '.');
  std::fprintf(stderr, "\r\033[K%s [%s] %3d %% %s", what_.c_str(), bar.c_str(), percent, note.c_str());
  std::fflush(stderr);
}

}  // namespace flamefield
