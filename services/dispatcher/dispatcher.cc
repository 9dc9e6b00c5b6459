#include "services/dispatcher/dispatcher.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>

#include "proto/utc.h"
#include "proto/version.h"
#include "services/dispatcher/orders.h"
#include "services/dispatcher/roster.h"
#include "services/ledger/ledger.h"
#include "services/log/log.h"
#include "services/spool/spool.h"

namespace flamefield {

namespace fs = std::filesystem;

namespace {

constexpr std::chrono::milliseconds kTick{50};

std::int64_t to_ns(std::chrono::milliseconds duration) {
  return std::chrono::nanoseconds(duration).count();
}

// What each kind of peer may ask for; "local" is a thread of our own process.
bool may(const std::string& role, const Message& message) {
  const bool of_worker = std::holds_alternative<Ready>(message) ||
                         std::holds_alternative<FetchSet>(message) ||
                         std::holds_alternative<Heartbeat>(message) ||
                         std::holds_alternative<Finish>(message) || std::holds_alternative<Fail>(message);
  const bool of_producer =
      std::holds_alternative<PutSet>(message) || std::holds_alternative<PutCapture>(message);
  if (role == "local") return true;
  if (role == "worker") return of_worker;
  if (role == "producer") return !of_worker;
  return role == "client" && !of_worker && !of_producer;
}

// A result file gets its final name. The directory is synced, so that the name survives the power too.
Result<> publish_file(const fs::path& data_dir, const std::string& path, std::int64_t token) {
  const fs::path from = data_dir / staged_path(path, token), to = data_dir / path;
  std::error_code problem;
  fs::rename(from, to, problem);
  if (problem)
    return unavailable(concat("cannot rename ", from.string()), problem.message(),
                       "does the worker share the data directory?");
  const int fd = ::open(to.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd >= 0) {
    ::fsync(fd);
    ::close(fd);
  }
  return {};
}

// Files of attempts that no lease covers any more.
void remove_staged(const fs::path& directory) {
  std::error_code problem;
  for (const auto& entry : fs::directory_iterator(directory, problem)) {
    if (entry.path().filename().string().find(".part-") != std::string::npos)
      fs::remove(entry.path(), problem);
  }
}

}  // namespace

struct Dispatcher::Impl {
  using Clock = Roster::Clock;
  struct Reply {
    std::string peer;
    std::uint64_t request;
    Message message;
  };

  Impl(Bus& bus, const DispatcherOptions& o, Ledger l, Spool s)
      : options(o), ledger(std::move(l)), spool(std::move(s)), router(bus), publisher(bus) {}

  Result<> start();
  Result<> adopt(const FrameSet& set, const SpoolLocation& location);
  Result<> serve_batch(Delivery first);
  void answer(Delivery& delivery);
  Result<Message> handle(Message& message, const std::string& peer);
  Result<> expire_leases();
  Result<> assign_work();
  void tell(std::string_view kind, const std::string& subject, const std::string& text, bool keep);

  Result<Message> on(PutSet& m, const std::string& peer);
  Result<Message> on(PutCapture& m, const std::string& peer);
  Result<Message> on(PutRig& m, const std::string& peer);
  Result<Message> on(LivePlan& m, const std::string& peer);
  Result<Message> on(Submit& m, const std::string& peer);
  Result<Message> on(PutMetrics& m, const std::string& peer);
  Result<Message> on(GetStatus& m, const std::string& peer);
  Result<Message> on(Ready& m, const std::string& peer);
  Result<Message> on(FetchSet& m, const std::string& peer);
  Result<Message> on(Heartbeat& m, const std::string& peer);
  Result<Message> on(Finish& m, const std::string& peer);
  Result<Message> on(Fail& m, const std::string& peer);
  template <class Other>
  Result<Message> on(Other&, const std::string&) {
    return invalid_input("message to the dispatcher", "it is an answer, not a question", "drop it");
  }

  DispatcherOptions options;
  Ledger ledger;
  Spool spool;
  Router router;
  Publisher publisher;
  LivePlan plan;
  Roster roster;
  std::vector<Reply> replies;  // sent when the batch is durable
  std::vector<Event> news;     // published likewise
  bool leases_unsure = false;  // a commit failed: memory and ledger may differ
  std::map<std::string, std::int64_t> counters;
  std::vector<std::string> endpoints, event_endpoints;
};

Dispatcher::Dispatcher(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Dispatcher::~Dispatcher() = default;

const std::vector<std::string>& Dispatcher::endpoints() const {
  return impl_->endpoints;
}
const std::vector<std::string>& Dispatcher::event_endpoints() const {
  return impl_->event_endpoints;
}

Result<std::unique_ptr<Dispatcher>> Dispatcher::open(Bus& bus, const DispatcherOptions& options) {
  auto ledger = Ledger::open(options.data_dir);
  if (!ledger) return tl::unexpected(ledger.error());
  const auto durable = ledger->last_location();
  if (!durable) return tl::unexpected(durable.error());
  auto spool = Spool::open({options.data_dir / "spool", options.segment_bytes}, *durable);
  if (!spool) return tl::unexpected(spool.error());
  std::error_code problem;
  fs::create_directories(options.data_dir / "volumes", problem);
  auto impl = std::make_unique<Impl>(bus, options, std::move(*ledger), std::move(*spool));
  if (auto ok = impl->start(); !ok) return tl::unexpected(ok.error());
  return std::unique_ptr<Dispatcher>(new Dispatcher(std::move(impl)));
}

Result<> Dispatcher::run(std::stop_token stop) {
  while (!stop.stop_requested()) {
    if (auto delivery = impl_->router.receive(kTick)) {
      if (auto ok = impl_->serve_batch(std::move(*delivery)); !ok)
        log_event(LogLevel::Error, "batch-refused", {{"error", ok.error().message}});
    }
    for (auto step : {&Impl::expire_leases, &Impl::assign_work}) {
      if (auto ok = (*impl_.*step)(); !ok) {
        impl_->leases_unsure = true;
        log_event(LogLevel::Error, "ledger-refused", {{"error", ok.error().message}});
      }
    }
  }
  return {};
}

// Binds last: whoever connects finds everything in order.
Result<> Dispatcher::Impl::start() {
  auto transaction = ledger.begin();
  if (!transaction) return tl::unexpected(transaction.error());
  const auto voided = ledger.void_all_leases();
  if (!voided) return tl::unexpected(voided.error());
  auto stored_plan = ledger.live_plan();
  if (!stored_plan) return tl::unexpected(stored_plan.error());
  plan = *stored_plan;
  for (const RecoveredSet& found : spool.recovered()) {
    if (auto ok = adopt(found.set, found.location); !ok) return ok;
  }
  if (auto ok = transaction->commit(); !ok) return ok;
  remove_staged(options.data_dir / "volumes");
  for (const std::string& endpoint : options.endpoints) {
    if (auto ok = router.bind(endpoint); !ok) return ok;
    endpoints.push_back(router.bound_endpoint());
  }
  for (const std::string& endpoint : options.event_endpoints) {
    if (auto ok = publisher.bind(endpoint); !ok) return ok;
    event_endpoints.push_back(publisher.bound_endpoint());
  }
  log_event(LogLevel::Info, "dispatcher-started",
            {{"endpoint", endpoints.empty() ? "" : endpoints[0]},
             {"leases_voided", *voided},
             {"sets_recovered", spool.recovered().size()}});
  return {};
}

// --- batches: many messages, one fdatasync, one commit

Result<> Dispatcher::Impl::serve_batch(Delivery first) {
  replies.clear();
  news.clear();
  const auto stored = [&]() -> Result<> {
    auto transaction = ledger.begin();
    if (!transaction) return tl::unexpected(transaction.error());
    if (leases_unsure) {
      if (auto voided = ledger.void_all_leases(); !voided) return tl::unexpected(voided.error());
      roster.void_leases();
    }
    answer(first);
    for (int i = 1; i < options.max_batch; ++i) {
      auto next = router.receive(std::chrono::milliseconds(0));
      if (!next) break;
      answer(*next);
    }
    if (auto ok = spool.sync(); !ok) return ok;
    if (auto ok = transaction->commit(); !ok) return ok;
    leases_unsure = false;
    return {};
  }();
  if (!stored) {
    leases_unsure = true;
    const Error error = stored.error();
    for (Reply& reply : replies) reply.message = Rejected{error};
    news.clear();
  }
  for (const Reply& reply : replies) {
    if (auto ok = router.send(reply.peer, reply.message, reply.request); !ok)
      ++counters["replies_undeliverable"];
  }
  for (const Event& event : news) publisher.publish(event);
  return stored;
}

void Dispatcher::Impl::answer(Delivery& delivery) {
  Result<Message> reply = Accepted{};
  if (!delivery.message) {
    ++counters["messages_malformed"];
    reply = tl::unexpected(delivery.message.error());
  } else if (!may(delivery.role, *delivery.message)) {
    ++counters["messages_forbidden"];
    reply = invalid_input("message to the dispatcher", concat("a ", delivery.role, " may not send it"),
                          "use the key of the right role");
  } else {
    reply = handle(*delivery.message, delivery.peer);
  }
  if (!reply) {
    replies.push_back({delivery.peer, delivery.request, Rejected{reply.error()}});
  } else if (delivery.request != 0) {
    replies.push_back({delivery.peer, delivery.request, std::move(*reply)});
  } else if (std::holds_alternative<LeaseLost>(*reply)) {
    replies.push_back({delivery.peer, 0, std::move(*reply)});
  }
}

// Each message has a transaction of its own within the batch: a refused one leaves no traces.
Result<Message> Dispatcher::Impl::handle(Message& message, const std::string& peer) {
  roster.seen(peer, Clock::now());
  auto transaction = ledger.begin_within();
  if (!transaction) return tl::unexpected(transaction.error());
  auto reply = std::visit([&](auto& m) { return on(m, peer); }, message);
  if (!reply) return reply;
  if (auto ok = transaction->commit(); !ok) return tl::unexpected(ok.error());
  return reply;
}

void Dispatcher::Impl::tell(std::string_view kind, const std::string& subject, const std::string& text,
                            bool keep) {
  Event event{utc_now_ns(), std::string(kind), subject, text};
  if (keep) {
    if (auto ok = ledger.add_event(event); !ok) ++counters["events_not_kept"];
    log_event(LogLevel::Info, kind, {{"subject", subject}, {"text", text}});
  }
  news.push_back(std::move(event));
}

// --- sets

// Enters a set into the ledger, and into the line of work when the live plan says so.
Result<> Dispatcher::Impl::adopt(const FrameSet& set, const SpoolLocation& location) {
  const std::int64_t now_ns = utc_now_ns();
  const auto added = ledger.add_set(set, location, now_ns);
  if (!added) return tl::unexpected(added.error());
  const bool live = set.kind == CaptureKind::Burst || set.kind == CaptureKind::Live;
  if (!*added || !plan.on || !live) return {};
  Submit submit;
  submit.sets = {{set.capture, set.index}};
  submit.processing = plan.processing;
  submit.priority = Priority::Live;
  if (auto placed = place_order(ledger, submit, now_ns); !placed) return tl::unexpected(placed.error());
  return {};
}

Result<Message> Dispatcher::Impl::on(PutSet& m, const std::string&) {
  const SetId id{m.set.capture, m.set.index};
  const auto known = ledger.has_set(id);
  if (!known) return tl::unexpected(known.error());
  if (*known) {
    ++counters["sets_resent"];
    return SetStored{id, true};
  }
  const auto location = spool.append(m.set);
  if (!location) return tl::unexpected(location.error());
  if (auto ok = adopt(m.set, *location); !ok) return tl::unexpected(ok.error());
  tell("set-stored", m.set.capture, concat("set ", m.set.index, " of pulse ", m.set.pulse), false);
  return SetStored{id, false};
}

Result<Message> Dispatcher::Impl::on(FetchSet& m, const std::string&) {
  const auto location = ledger.location_of(m.id);
  if (!location) return tl::unexpected(location.error());
  auto set = spool.read(*location);
  if (!set) {
    ++counters["sets_unreadable"];
    return tl::unexpected(set.error());
  }
  return SetData{std::move(*set)};
}

Result<Message> Dispatcher::Impl::on(PutCapture& m, const std::string&) {
  if (auto ok = ledger.put_capture(m); !ok) return tl::unexpected(ok.error());
  tell(m.finished_time_ns == 0 ? "capture-started" : "capture-finished", m.id, concat(m.pulses, " pulses"),
       true);
  return Accepted{};
}

// --- orders

Result<Message> Dispatcher::Impl::on(PutRig& m, const std::string&) {
  auto id = ledger.put_rig(m.rig, utc_now_ns());
  if (!id) return tl::unexpected(id.error());
  return RigStored{*id};
}

Result<Message> Dispatcher::Impl::on(LivePlan& m, const std::string&) {
  if (m.on) {
    if (auto ok = check_processing(ledger, m.processing); !ok) return tl::unexpected(ok.error());
  }
  if (auto ok = ledger.put_live_plan(m); !ok) return tl::unexpected(ok.error());
  plan = m;
  return Accepted{};
}

Result<Message> Dispatcher::Impl::on(Submit& m, const std::string&) {
  auto submitted = place_order(ledger, m, utc_now_ns());
  if (!submitted) return tl::unexpected(submitted.error());
  return std::move(*submitted);
}

Result<Message> Dispatcher::Impl::on(PutMetrics& m, const std::string&) {
  if (auto ok = ledger.put_metrics(m); !ok) return tl::unexpected(ok.error());
  return Accepted{};
}

Result<Message> Dispatcher::Impl::on(GetStatus&, const std::string&) {
  auto status = ledger.status(utc_now_ns());
  if (!status) return tl::unexpected(status.error());
  status->program_version = program_version();
  status->workers = roster.status(Clock::now());
  status->counters = counters;
  for (auto& waiting : status->waiting) {
    if (waiting.why.empty())
      waiting.why = roster.has_workers() ? "all workers are busy" : "no worker is connected";
  }
  return std::move(*status);
}

// --- workers

Result<Message> Dispatcher::Impl::on(Ready& m, const std::string& peer) {
  if (m.program_version != program_version())
    return invalid_input(concat("worker ", m.worker, " of version ", m.program_version),
                         concat("the dispatcher is ", program_version()), "install the same version");
  roster.ready(peer, m.worker, Clock::now());
  return Accepted{};
}

Result<Message> Dispatcher::Impl::on(Heartbeat& m, const std::string&) {
  if (!roster.extend(m.progress.token, Clock::now() + options.lease)) return LeaseLost{m.progress.token};
  publisher.publish(m);
  return Accepted{};
}

Result<Message> Dispatcher::Impl::on(Finish& m, const std::string&) {
  const auto commit = ledger.finish(m.token, m.run, utc_now_ns());
  if (!commit) return tl::unexpected(commit.error());
  if (*commit == Ledger::Commit::AlreadyDone) return Committed{m.run.id};
  if (*commit == Ledger::Commit::Stale) {
    ++counters["stale_commits_refused"];
    return invalid_input(concat("result of run ", m.run.id), "the lease was lost and given to another worker",
                         "drop it");
  }
  for (const std::string& path : {m.run.volume_path, m.run.projections_path}) {
    if (path.empty()) continue;
    if (auto ok = publish_file(options.data_dir, path, m.token); !ok) return tl::unexpected(ok.error());
  }
  roster.end(m.token);
  tell("run-committed", m.run.id, concat("worker ", m.run.worker), true);
  return Committed{m.run.id};
}

Result<Message> Dispatcher::Impl::on(Fail& m, const std::string&) {
  const auto attempt = ledger.attempt_of_token(m.token);
  if (!attempt) return tl::unexpected(attempt.error());
  // Only what may be different next time is tried again.
  std::optional<std::int64_t> retry_at_ns;
  if (m.error.code == ErrorCode::Unavailable && *attempt < options.max_attempts)
    retry_at_ns = utc_now_ns() + (to_ns(options.back_off) << std::min(*attempt - 1, 10));
  const auto failed = ledger.fail(m.token, m.error.message, retry_at_ns);
  if (!failed) return tl::unexpected(failed.error());
  roster.end(m.token);
  if (*failed)
    tell(retry_at_ns ? "job-put-back" : "job-failed", concat("lease ", m.token), m.error.message, true);
  return Accepted{};
}

Result<> Dispatcher::Impl::expire_leases() {
  const auto now = Clock::now();
  roster.drop_silent(now - options.lease);
  const auto tokens = roster.expired(now);
  if (tokens.empty()) return {};
  news.clear();
  auto transaction = ledger.begin();
  if (!transaction) return tl::unexpected(transaction.error());
  for (std::int64_t token : tokens) {
    const std::string worker = roster.holder_of(token).value_or("");
    const auto attempt = ledger.attempt_of_token(token);
    if (!attempt) return tl::unexpected(attempt.error());
    const bool again = *attempt < options.max_attempts;
    const std::string reason = concat("worker ", worker, " was silent for ", options.lease.count(), " ms");
    const auto failed = ledger.fail(token, reason, again ? std::optional(utc_now_ns()) : std::nullopt);
    if (!failed) return tl::unexpected(failed.error());
    ++counters["leases_expired"];
    tell("lease-expired", worker, concat("lease ", token), true);
  }
  if (auto ok = transaction->commit(); !ok) return ok;
  for (std::int64_t token : tokens) roster.end(token);
  for (const Event& event : news) publisher.publish(event);
  return {};
}

Result<> Dispatcher::Impl::assign_work() {
  while (roster.has_idle() && !leases_unsure) {
    const std::string peer = *roster.take_idle();
    const auto lease = [&]() -> Result<std::optional<Lease>> {
      auto transaction = ledger.begin();
      if (!transaction) return tl::unexpected(transaction.error());
      auto next = ledger.lease_next(roster.name_of(peer), utc_now_ns(), options.lease.count());
      if (!next || !*next) return next;
      if (auto ok = transaction->commit(); !ok) return tl::unexpected(ok.error());
      return next;
    }();
    if (!lease || !*lease) {
      roster.ready(peer, roster.name_of(peer), Clock::now());
      if (!lease) return tl::unexpected(lease.error());
      return {};
    }
    const Lease& given = **lease;
    roster.lease(peer, given.token, given.job.id, Clock::now() + options.lease);
    if (auto ok = router.send(peer, given); !ok) {
      // The worker is gone: the job goes back at once.
      if (auto back = ledger.fail(given.token, ok.error().message, utc_now_ns()); !back)
        return tl::unexpected(back.error());
      roster.end(given.token);
      roster.gone(peer);
      continue;
    }
    publisher.publish(Event{utc_now_ns(), "job-leased", given.job.run_id, roster.name_of(peer)});
  }
  return {};
}

}  // namespace flamefield
