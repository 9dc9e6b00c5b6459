#include "services/upkeep/retention.h"

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "services/ledger/books.h"
#include "services/ledger/reader.h"
#include "services/spool/reader.h"

namespace flamefield {

namespace fs = std::filesystem;

namespace {

class Inspector {
 public:
  Inspector(const fs::path& directory, LedgerReader ledger, const std::vector<StoredSet>& sets)
      : ledger_(std::move(ledger)), spool_(directory / "spool") {
    for (const StoredSet& set : sets) {
      places_[set.id] = set.location;
      captures_.insert(set.id.capture);
    }
  }

  // Why the run could not be made again; empty: it could.
  std::string obstacle(const WorkRow& row) {
    if (row.state != JobState::Done) return "it is not done";
    if (std::ranges::find(row.tags, "keep") != row.tags.end()) return "it carries the tag keep";
    const Processing& processing = row.run.processing;
    if (!rigs_.contains(processing.rig_id))
      rigs_[processing.rig_id] = ledger_.rig(processing.rig_id).has_value();
    if (!rigs_[processing.rig_id]) return concat("rig ", processing.rig_id, " is not there");
    for (const std::string& capture :
         {processing.dark_capture, processing.background_capture, processing.flat_capture}) {
      if (!capture.empty() && !captures_.contains(capture))
        return concat("capture ", capture, " is not there");
    }
    if (row.run.inputs.empty()) return "it names no sets";
    for (const SetId& id : row.run.inputs) {
      if (!is_whole(id)) return concat("set ", id.index, " of capture ", id.capture, " cannot be read");
    }
    return {};
  }

 private:
  bool is_whole(const SetId& id) {
    const auto known = whole_.find(id);
    if (known != whole_.end()) return known->second;
    const auto place = places_.find(id);
    return whole_[id] = place != places_.end() && spool_.read(place->second).has_value();
  }

  LedgerReader ledger_;
  SpoolReader spool_;
  std::map<SetId, SpoolLocation> places_;
  std::map<SetId, bool> whole_;
  std::set<std::string> captures_;
  std::map<std::string, bool> rigs_;
};

}  // namespace

Result<RetentionPlan> plan_retention(const fs::path& directory, const Filter& filter) {
  auto query = LedgerQuery::open(directory);
  if (!query) return tl::unexpected(query.error());
  auto reader = LedgerReader::open(directory);
  if (!reader) return tl::unexpected(reader.error());
  auto books = Books::open(directory);
  if (!books) return tl::unexpected(books.error());
  const auto sets = books->sets();
  if (!sets) return tl::unexpected(sets.error());
  const auto rows = query->work(filter, std::numeric_limits<std::int64_t>::max());
  if (!rows) return tl::unexpected(rows.error());
  Inspector inspector(directory, std::move(*reader), *sets);
  RetentionPlan plan;
  for (const WorkRow& row : *rows) {
    if (row.retired) continue;
    std::string why = inspector.obstacle(row);
    if (!why.empty()) {
      plan.kept.push_back({row.run.id, std::move(why)});
      continue;
    }
    plan.run_ids.push_back(row.run.id);
    plan.bytes += row.run.volume_bytes + row.run.projections_bytes;
  }
  return plan;
}

}  // namespace flamefield
