#pragma once

#include "reconstruct/ranks.h"

namespace flamefield {

// The processes that mpirun or srun has started together. One a process, before any other thread talks to
// MPI.
class MpiRanks : public Ranks {
 public:
  MpiRanks(int* argc, char*** argv);
  ~MpiRanks() override;  // waits for the others
  MpiRanks(const MpiRanks&) = delete;
  MpiRanks& operator=(const MpiRanks&) = delete;

  int rank() const override { return rank_; }
  int count() const override { return count_; }
  void exchange(int to, ConstBytes out, int from, Bytes in) override;
  void broadcast(int from, Bytes bytes) override;
  std::vector<std::vector<std::byte>> gather(ConstBytes bytes) override;

 private:
  int rank_ = 0, count_ = 1;
};

}  // namespace flamefield
