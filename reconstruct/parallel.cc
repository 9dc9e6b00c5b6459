#include "reconstruct/parallel.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace flamefield {

namespace {

// Loops follow each other within microseconds; waking a sleeping thread takes longer than many of them. So
// threads look a while before they sleep: about 20 us.
constexpr int kLooks = 500;

template <class Condition>
bool comes_soon(const Condition& condition) {
  for (int i = 0; i < kLooks; ++i) {
    if (condition()) return true;
#if defined(__x86_64__)
    __builtin_ia32_pause();
#endif
  }
  return false;
}

}  // namespace

struct Team::State {
  std::mutex mutex;
  std::condition_variable wake, done;
  const std::function<void(std::size_t)>* body = nullptr;
  std::size_t blocks = 0;
  std::atomic<std::size_t> next{0};
  std::atomic<std::size_t> round{0};  // calls of run() so far
  std::atomic<int> busy{0};           // helpers still in this round
  std::atomic<bool> quit{false};
  std::exception_ptr error;
  std::vector<std::thread> helpers;

  void work() {
    for (;;) {
      const std::size_t block = next.fetch_add(1, std::memory_order_relaxed);
      if (block >= blocks) return;
      try {
        (*body)(block);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!error) error = std::current_exception();
      }
    }
  }

  void help() {
    for (std::size_t seen = 0;; ++seen) {
      const auto called = [&] { return quit || round != seen; };
      if (!comes_soon(called)) {
        std::unique_lock lock(mutex);
        wake.wait(lock, called);
      }
      if (quit) return;
      work();
      if (--busy > 0) continue;
      const std::lock_guard lock(mutex);  // whoever waits either sleeps already or will see busy == 0
      done.notify_one();
    }
  }
};

Team::Team(int threads) : state_(std::make_unique<State>()) {
  const int wanted = threads > 0 ? threads : static_cast<int>(std::thread::hardware_concurrency());
  for (int i = 1; i < std::max(wanted, 1); ++i) {
    state_->helpers.emplace_back([state = state_.get()] { state->help(); });
  }
}

Team::~Team() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->quit = true;
  }
  state_->wake.notify_all();
  for (std::thread& helper : state_->helpers) helper.join();
}

int Team::threads() const {
  return static_cast<int>(state_->helpers.size()) + 1;
}

void Team::run(std::size_t blocks, const std::function<void(std::size_t)>& body) {
  State& s = *state_;
  if (s.helpers.empty() || blocks <= 1) {
    for (std::size_t block = 0; block < blocks; ++block) body(block);
    return;
  }
  s.body = &body;
  s.blocks = blocks;
  s.next = 0;
  s.error = nullptr;
  s.busy = static_cast<int>(s.helpers.size());
  {
    const std::lock_guard lock(s.mutex);
    ++s.round;
  }
  s.wake.notify_all();
  s.work();
  const auto finished = [&] { return s.busy == 0; };
  if (!comes_soon(finished)) {
    std::unique_lock lock(s.mutex);
    s.done.wait(lock, finished);
  }
  if (s.error) std::rethrow_exception(s.error);
}

void Team::run_ranges(std::size_t count, std::size_t grain,
                      const std::function<void(std::size_t, std::size_t)>& body) {
  run((count + grain - 1) / grain,
      [&](std::size_t block) { body(block * grain, std::min(count, (block + 1) * grain)); });
}

}  // namespace flamefield
