#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace flamefield {

// The processes that work on one solve together. All of them call the same functions in the same order. A
// lost peer is no error that a solver could handle: whoever implements this ends the program then.
class Ranks {
 public:
  using Bytes = std::span<std::byte>;
  using ConstBytes = std::span<const std::byte>;
  static constexpr int kNobody = -1;

  virtual ~Ranks() = default;
  virtual int rank() const = 0;  // 0 .. count() - 1
  virtual int count() const = 0;

  // To one, from another, at the same time; kNobody: not this way.
  virtual void exchange(int to, ConstBytes out, int from, Bytes in) = 0;
  virtual void broadcast(int from, Bytes bytes) = 0;
  // What every rank gives, in the order of the ranks; sizes may differ.
  virtual std::vector<std::vector<std::byte>> gather(ConstBytes bytes) = 0;

  void send(int to, ConstBytes out) { exchange(to, out, kNobody, {}); }
  void receive(int from, Bytes in) { exchange(kNobody, {}, from, in); }
};

}  // namespace flamefield
