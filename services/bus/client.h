#pragma once

#include <chrono>
#include <deque>
#include <optional>
#include <string>

#include "services/bus/bus.h"

namespace flamefield {

// Questions and answers over a Dealer. One thread.
class Client {
 public:
  // `name` must be unique on the bus; unique_name() makes one.
  static Result<Client> connect(Bus& bus, const std::string& role, const std::string& name,
                                const std::string& endpoint);

  // Sends the question and waits for its answer. A Rejected answer comes back as its error; Unavailable
  // when none came in time (the question may still have been carried out).
  Result<Message> ask(const Message& question, std::chrono::milliseconds timeout);

  // The same when only one kind of answer makes sense.
  template <class Answer>
  Result<Answer> ask_for(const Message& question, std::chrono::milliseconds timeout) {
    auto answer = ask(question, timeout);
    if (!answer) return tl::unexpected(answer.error());
    if (auto* expected = std::get_if<Answer>(&*answer)) return std::move(*expected);
    return invalid_input("answer on the bus", "its kind does not fit the question",
                         "are both programs of one version?");
  }

  // Without waiting for an answer.
  Result<> tell(const Message& message) { return dealer_.send(message); }

  // The same, and its answer comes out of next(): only the last one's.
  Result<> post(const Message& message);

  // The next message that answers no question of ask(), e.g. a lease.
  std::optional<Message> next(std::chrono::milliseconds timeout);

 private:
  explicit Client(Dealer dealer) : dealer_(std::move(dealer)) {}

  Dealer dealer_;
  std::uint64_t last_request_ = 0, posted_ = 0;
  std::deque<Message> unasked_;
};

// "<stem>-<host>-<pid>-<counter>": unique per process and call.
std::string unique_name(const std::string& stem);

}  // namespace flamefield
