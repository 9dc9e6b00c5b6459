#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "services/dispatcher/cost_model.h"
#include "services/dispatcher/dispatcher.h"
#include "services/dispatcher/job_queue.h"
#include "services/dispatcher/roster.h"
#include "services/ledger/ledger.h"
#include "services/spool/spool.h"

// Known to this folder only: the dispatcher's state, and what its files do with it.
namespace flamefield {

struct Dispatcher::Impl {
  using Clock = Roster::Clock;
  struct Letter {
    std::string peer;
    std::uint64_t request;
    Message message;
  };
  struct Sender {
    const std::string& peer;
    bool in_process;
  };

  Impl(Bus& b, const DispatcherOptions& o, Ledger l, Spool s)
      : bus(b), options(o), ledger(std::move(l)), spool(std::move(s)), router(b), publisher(b) {}

  // dispatcher.cc: rounds
  Result<> start();
  Result<> reload();  // memory from the ledger, where every lease is void
  void round(std::optional<Delivery> first);
  Result<> write_round(std::optional<Delivery>& first);  // takes it when it was answered
  void refuse_round(const std::optional<Delivery>& unanswered, const Error& error, Clock::time_point now);
  void answer(Delivery& delivery);
  Result<Message> handle(Message& message, const Sender& sender);
  void tell(std::string_view kind, const std::string& subject, const std::string& text, bool keep);

  // storing.cc: sets and captures
  Result<> adopt(const FrameSet& set, const SpoolLocation& location);
  Result<Message> on(PutSet& m, const Sender&);
  Result<Message> on(FetchSet& m, const Sender&);
  Result<Message> on(PutCapture& m, const Sender&);

  // leasing.cc: workers
  std::optional<Error> objection(const Ready& m) const;
  Result<Message> on(Ready& m, const Sender& sender);
  Result<Message> on(Heartbeat& m, const Sender&);
  Result<Message> on(Finish& m, const Sender&);
  Result<Message> on(Fail& m, const Sender&);
  Result<> end_lease(std::int64_t token, Failure failure, std::string_view event);
  Result<> expire_leases();
  Result<> assign_work();
  void enqueue(const QueuedJob& job);

  // controlling.cc: orders, and questions about them
  Result<> place(const Submit& submit, Submitted& answer);
  Result<Message> on(PutRig& m, const Sender&);
  Result<Message> on(PutCalibration& m, const Sender&);
  Result<Message> on(LivePlan& m, const Sender&);
  Result<Message> on(Submit& m, const Sender&);
  Result<Message> on(PutMetrics& m, const Sender&);
  Result<Message> on(ControlJobs& m, const Sender&);
  Result<Message> on(GetJobs& m, const Sender&);
  Result<Message> on(GetStatus& m, const Sender&);

  // keeping.cc: upkeep
  Result<Message> on(PutTags& m, const Sender&);
  Result<Message> on(AcceptRig& m, const Sender&);
  Result<Message> on(PutSchedule& m, const Sender&);
  Result<Message> on(DropSchedule& m, const Sender&);
  Result<Message> on(ScheduleRan& m, const Sender&);
  Result<Message> on(Retire& m, const Sender&);
  std::string why(std::int64_t job_id, const std::string& last_failure) const;
  template <class Other>
  Result<Message> on(Other&, const Sender&) {
    return invalid_input("message to the dispatcher", "it is an answer, not a question", "drop it");
  }

  Bus& bus;
  DispatcherOptions options;
  Ledger ledger;
  Spool spool;
  Router router;
  Publisher publisher;
  LivePlan plan;
  Roster roster;
  JobQueue queue;
  CostModel costs;
  std::vector<Letter> letters;            // sent when the round is durable
  std::vector<Event> news;                // published likewise
  std::vector<std::string> retired;       // files, removed likewise
  bool names_unsynced = false;            // results were renamed in this round
  std::vector<std::int64_t> undelivered;  // leases whose worker had gone
  bool unsure = false;                    // a commit failed: memory and ledger may differ
  Clock::time_point retry_at;             // when to try again without being asked
  Clock::time_point next_look;            // for workers that are silent
  std::string data_id;                    // of the volumes directory
  std::map<std::string, std::int64_t> counters;
  std::vector<std::string> endpoints, event_endpoints;
};

inline std::int64_t to_ns(std::chrono::milliseconds duration) {
  return std::chrono::nanoseconds(duration).count();
}

// Back-offs are on the steady clock: setting the machine's time neither ends nor prolongs them.
inline std::int64_t steady_ns() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

}  // namespace flamefield
