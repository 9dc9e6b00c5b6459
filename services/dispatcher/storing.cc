// The dispatcher's part on frame sets and captures.
#include "proto/utc.h"
#include "services/dispatcher/desk.h"

namespace flamefield {

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
  Submitted placed;
  return place(submit, placed);
}

Result<Message> Dispatcher::Impl::on(PutSet& m, const Sender&) {
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

Result<Message> Dispatcher::Impl::on(FetchSet& m, const Sender&) {
  const auto location = ledger.location_of(m.id);
  if (!location) return tl::unexpected(location.error());
  auto set = spool.read(*location);
  if (!set) {
    ++counters["sets_unreadable"];
    return tl::unexpected(set.error());
  }
  return SetData{std::move(*set)};
}

namespace {

// Trouble has a name of its own, so that whoever watches for it need not read the text.
std::string_view event_of(const PutCapture& capture) {
  if (capture.end == CaptureEnd::Interrupted) return "capture-interrupted";
  if (capture.end == CaptureEnd::Storage && capture.finished_time_ns == 0) return "capture-stopped";
  return capture.finished_time_ns == 0 ? "capture-started" : "capture-finished";
}

}  // namespace

Result<Message> Dispatcher::Impl::on(PutCapture& m, const Sender&) {
  if (auto ok = ledger.put_capture(m); !ok) return tl::unexpected(ok.error());
  tell(event_of(m), m.id, concat(m.pulses, " pulses", m.end_reason.empty() ? "" : concat(", ", m.end_reason)),
       true);
  return Accepted{};
}

}  // namespace flamefield
