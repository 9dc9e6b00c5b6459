#pragma once

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "proto/check.h"
#include "reconstruct/ranks.h"

namespace flamefield {

// Ranks that are threads of one process: everything but the network.
class ThreadRanks {
 public:
  // work(ranks) in `count` threads; returns when all are done. The first exception is rethrown.
  static void run(int count, const std::function<void(Ranks&)>& work) {
    Post post(count);
    std::vector<std::exception_ptr> errors(static_cast<std::size_t>(count));
    std::vector<std::jthread> threads;
    for (int rank = 0; rank < count; ++rank) {
      threads.emplace_back([&, rank] {
        Member member(post, rank);
        try {
          work(member);
        } catch (...) {
          errors[static_cast<std::size_t>(rank)] = std::current_exception();
        }
      });
    }
    threads.clear();
    for (const std::exception_ptr& error : errors)
      if (error) std::rethrow_exception(error);
  }

 private:
  using Letter = std::vector<std::byte>;
  struct Post {
    explicit Post(int ranks) : count(ranks) {}
    int count;
    std::mutex mutex;
    std::condition_variable arrived;
    std::map<std::pair<int, int>, std::deque<Letter>> letters;  // from, to
  };

  class Member : public Ranks {
   public:
    Member(Post& post, int rank) : post_(post), rank_(rank) {}
    int rank() const override { return rank_; }
    int count() const override { return post_.count; }
    void exchange(int to, ConstBytes out, int from, Bytes in) override {
      if (to != kNobody) put(to, out);
      if (from == kNobody) return;
      const Letter letter = take(from);
      expect(letter.size() == in.size(), "both sides mean the same message");
      std::ranges::copy(letter, in.begin());
    }
    void broadcast(int from, Bytes bytes) override {
      for (int r = 0; r < post_.count && rank_ == from; ++r)
        if (r != from) put(r, bytes);
      if (rank_ != from) receive(from, bytes);
    }
    std::vector<std::vector<std::byte>> gather(ConstBytes bytes) override {
      for (int r = 0; r < post_.count; ++r) put(r, bytes);
      std::vector<Letter> out;
      for (int r = 0; r < post_.count; ++r) out.push_back(take(r));
      return out;
    }

   private:
    void put(int to, ConstBytes bytes) {
      {
        const std::lock_guard lock(post_.mutex);
        post_.letters[{rank_, to}].emplace_back(bytes.begin(), bytes.end());
      }
      post_.arrived.notify_all();
    }
    Letter take(int from) {
      std::unique_lock lock(post_.mutex);
      std::deque<Letter>& box = post_.letters[{from, rank_}];
      post_.arrived.wait(lock, [&] { return !box.empty(); });
      Letter out = std::move(box.front());
      box.pop_front();
      return out;
    }

    Post& post_;
    int rank_;
  };
};

}  // namespace flamefield
