// The dispatcher's part on upkeep: tags, calibrations, schedules, retirement.
#include "proto/utc.h"
#include "services/dispatcher/desk.h"

namespace flamefield {

Result<Message> Dispatcher::Impl::on(PutTags& m, const Sender&) {
  if (auto ok = ledger.put_tags(m); !ok) return tl::unexpected(ok.error());
  return Accepted{};
}

Result<Message> Dispatcher::Impl::on(AcceptRig& m, const Sender&) {
  if (auto ok = ledger.accept_rig(m, utc_now_ns()); !ok) return tl::unexpected(ok.error());
  tell("rig-accepted", m.rig_id, "volumes made with another one are stale", true);
  return Accepted{};
}

Result<Message> Dispatcher::Impl::on(PutSchedule& m, const Sender&) {
  if (auto ok = ledger.put_schedule(m.schedule); !ok) return tl::unexpected(ok.error());
  tell("schedule-stored", m.schedule.name, m.schedule.cron, true);
  return Accepted{};
}

Result<Message> Dispatcher::Impl::on(DropSchedule& m, const Sender&) {
  if (auto ok = ledger.drop_schedule(m.name); !ok) return tl::unexpected(ok.error());
  tell("schedule-dropped", m.name, "", true);
  return Accepted{};
}

Result<Message> Dispatcher::Impl::on(ScheduleRan& m, const Sender&) {
  if (auto ok = ledger.schedule_ran(m); !ok) return tl::unexpected(ok.error());
  tell("schedule-ran", m.name, concat(m.outcome, ": ", m.text), true);
  return Accepted{};
}

Result<Message> Dispatcher::Impl::on(Retire& m, const Sender&) {
  auto files = ledger.retire(m, utc_now_ns());
  if (!files) return tl::unexpected(files.error());
  tell("runs-retired", concat(m.run_ids.size(), " runs"), concat(files->size(), " files"), true);
  retired.insert(retired.end(), files->begin(), files->end());
  return Accepted{};
}

}  // namespace flamefield
