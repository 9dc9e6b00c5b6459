#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace flamefield {

// The only threads of the mathematics. Work comes in blocks whose borders depend on the problem alone; which
// thread runs which block is left to chance. As long as each block writes only what it owns, results are
// bit-identical for any number of threads.
class Team {
 public:
  explicit Team(int threads = 0);  // 0: as many as the machine has
  ~Team();
  Team(const Team&) = delete;
  Team& operator=(const Team&) = delete;

  int threads() const;

  // body(block) for block = 0 .. blocks - 1; returns when all are done. The first exception is rethrown.
  // Not to be called from within a body.
  void run(std::size_t blocks, const std::function<void(std::size_t)>& body);

  // body(begin, end) over consecutive pieces of 0 .. count of `grain` items each.
  void run_ranges(std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t, std::size_t)>& body);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace flamefield
