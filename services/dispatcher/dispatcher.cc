#include "services/dispatcher/dispatcher.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "proto/utc.h"
#include "services/bus/roles.h"
#include "services/dispatcher/desk.h"
#include "services/log/log.h"
#include "services/store/data_id.h"

namespace flamefield {

namespace fs = std::filesystem;

namespace {

constexpr std::chrono::milliseconds kTick{50};

// Files of attempts that no lease covers any more.
void remove_staged(const fs::path& directory) {
  std::error_code problem;
  for (const auto& entry : fs::directory_iterator(directory, problem)) {
    if (entry.path().filename().string().find(".part-") != std::string::npos)
      fs::remove(entry.path(), problem);
  }
}

// New names of results: one sync makes them all durable.
void sync_directory(const fs::path& directory) {
  const int fd = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  ::fsync(fd);
  ::close(fd);
}

void remove_files(const fs::path& data_dir, const std::vector<std::string>& files) {
  std::error_code problem;
  for (const std::string& file : files) fs::remove(data_dir / file, problem);
}

}  // namespace

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
  while (!stop.stop_requested()) impl_->round(impl_->router.receive(kTick));
  return {};
}

// Binds last: whoever connects finds everything in order.
Result<> Dispatcher::Impl::start() {
  auto transaction = ledger.begin();
  if (!transaction) return tl::unexpected(transaction.error());
  const auto voided = ledger.void_all_leases(true);
  if (!voided) return tl::unexpected(voided.error());
  auto stored_plan = ledger.live_plan();
  if (!stored_plan) return tl::unexpected(stored_plan.error());
  plan = *stored_plan;
  constexpr std::int64_t kRunsToLearnFrom = 2000;
  const auto known = ledger.costs(kRunsToLearnFrom);
  if (!known) return tl::unexpected(known.error());
  for (const RunCost& run : *known)
    costs.observe({run.setup, run.solver, run.work}, {run.wall_s, run.peak_rss_mib});
  for (const RecoveredSet& found : spool.recovered()) {
    if (auto ok = adopt(found.set, found.location); !ok) return ok;
  }
  if (auto ok = reload(); !ok) return ok;
  if (auto ok = transaction->commit(); !ok) return ok;
  remove_staged(options.data_dir / "volumes");
  data_id = make_data_id(options.data_dir).value_or("");  // not on a full disk: then nobody is asked for it
  if (const auto files = ledger.retired_files()) remove_files(options.data_dir, *files);
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
             {"jobs_waiting", queue.size()},
             {"sets_recovered", spool.recovered().size()}});
  return {};
}

Result<> Dispatcher::Impl::reload() {
  const auto jobs = ledger.queued_jobs();
  if (!jobs) return tl::unexpected(jobs.error());
  const auto paused = ledger.paused_all();
  if (!paused) return tl::unexpected(paused.error());
  roster.void_leases();
  undelivered.clear();
  queue.clear();
  queue.pause_all(*paused);
  for (const QueuedJob& job : *jobs) enqueue(job);
  return {};
}

// --- rounds: many messages, one fdatasync, one commit, and only then answers

void Dispatcher::Impl::round(std::optional<Delivery> first) {
  const auto now = Clock::now();
  if (now >= next_look) {
    roster.drop_silent(now - options.lease);
    next_look = now + kTick;
  }
  const bool due = unsure ? now >= retry_at
                          : !undelivered.empty() || !roster.expired(now).empty() ||
                                (roster.has_idle() && queue.size() > 0);
  if (!first && !due) return;
  letters.clear();
  news.clear();
  retired.clear();
  if (const auto written = write_round(first); !written)
    refuse_round(first, written.error(), now);
  else
    remove_files(options.data_dir, retired);
  for (const Letter& letter : letters) {
    if (auto ok = router.send(letter.peer, letter.message, letter.request); ok) continue;
    ++counters["replies_undeliverable"];
    if (const auto* lease = std::get_if<Lease>(&letter.message)) undelivered.push_back(lease->token);
  }
  for (const Event& event : news) publisher.publish(event);
}

// Nothing of the round happened. Whoever asked is told; who only told something will do so again.
void Dispatcher::Impl::refuse_round(const std::optional<Delivery>& unanswered, const Error& error,
                                    Clock::time_point now) {
  unsure = true;
  ++counters["rounds_refused"];
  if (unanswered) letters.push_back({unanswered->peer, unanswered->request, Accepted{}});
  std::erase_if(letters, [](const Letter& letter) { return letter.request == 0; });
  for (Letter& letter : letters) letter.message = Rejected{error};
  news.clear();
  if (now < retry_at) return;
  retry_at = now + std::chrono::seconds(1);
  log_event(LogLevel::Error, "round-refused", {{"error", error.message}});
}

Result<> Dispatcher::Impl::write_round(std::optional<Delivery>& first) {
  auto transaction = ledger.begin();
  if (!transaction) return tl::unexpected(transaction.error());
  if (unsure) {
    if (auto voided = ledger.void_all_leases(false); !voided) return tl::unexpected(voided.error());
    if (auto ok = reload(); !ok) return ok;
    unsure = false;
  }
  if (first) {
    answer(*first);
    first.reset();
    for (int i = 1; i < options.max_batch; ++i) {
      auto next = router.receive(std::chrono::milliseconds(0));
      if (!next) break;
      answer(*next);
    }
  }
  if (auto ok = expire_leases(); !ok) return ok;
  if (auto ok = assign_work(); !ok) return ok;
  if (std::exchange(names_unsynced, false)) sync_directory(options.data_dir / "volumes");
  if (auto ok = spool.sync(); !ok) return ok;
  return transaction->commit();
}

void Dispatcher::Impl::answer(Delivery& delivery) {
  Result<Message> reply = Accepted{};
  if (!delivery.message) {
    ++counters["messages_malformed"];
    reply = tl::unexpected(delivery.message.error());
  } else if (!may_send(delivery.role, *delivery.message)) {
    ++counters["messages_forbidden"];
    reply = tl::unexpected(forbidden("the dispatcher", delivery.role));
  } else {
    reply = handle(*delivery.message, {delivery.peer, delivery.role == "local"});
  }
  if (!reply) {
    letters.push_back({delivery.peer, delivery.request, Rejected{reply.error()}});
  } else if (delivery.request != 0) {
    letters.push_back({delivery.peer, delivery.request, std::move(*reply)});
  } else if (std::holds_alternative<LeaseLost>(*reply) || std::holds_alternative<Rejected>(*reply)) {
    letters.push_back({delivery.peer, 0, std::move(*reply)});
  }
}

namespace {

// They change nothing in the ledger, and are most of what a thousand workers say.
bool only_talks(const Message& message) {
  return std::holds_alternative<Ready>(message) || std::holds_alternative<Heartbeat>(message) ||
         std::holds_alternative<FetchSet>(message);
}

}  // namespace

// Each message has a transaction of its own within the round: a refused one leaves no traces.
Result<Message> Dispatcher::Impl::handle(Message& message, const Sender& sender) {
  roster.seen(sender.peer, Clock::now());
  if (only_talks(message)) return std::visit([&](auto& m) { return on(m, sender); }, message);
  auto transaction = ledger.begin_within();
  if (!transaction) return tl::unexpected(transaction.error());
  auto reply = std::visit([&](auto& m) { return on(m, sender); }, message);
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

}  // namespace flamefield
