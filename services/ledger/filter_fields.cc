#include "services/ledger/filter_fields.h"

#include <array>

namespace flamefield {

namespace {

// A volume is stale when the calibration that now counts for its pulse is another one, accepted after the
// volume was made. The first line is quick, and holds back the rest from what is newer than every
// calibration.
constexpr std::string_view kStale =
    "(r.committed_time_ns < (SELECT max(accepted_time_ns) FROM accepted_rigs) AND "
    "coalesce((SELECT a.rig_id <> r.rig_id AND a.accepted_time_ns > r.committed_time_ns FROM accepted_rigs a "
    "WHERE a.since_ns <= s.pulse_time_ns ORDER BY a.accepted_time_ns DESC LIMIT 1), 0))";

using enum FieldType;
constexpr std::array<FilterField, 26> kFields = {{
    {"capture", Text, false, "r.capture", "s.capture", "its name"},
    {"kind", Text, false, "c.kind", "c.kind", "of the capture: dark background flat board burst live"},
    {"index", Number, false, "r.first_idx", "s.idx", "of the set in its capture, from 0"},
    {"pulse", Number, false, "s.pulse", "s.pulse", "trigger pulse of the set"},
    {"time", Time, false, "s.pulse_time_ns", "s.pulse_time_ns", "of the pulse"},
    {"frames", Number, false, "s.frames", "s.frames", "of the set"},
    {"losses", Number, false, "s.losses", "s.losses", "cameras that the set lacks"},
    {"tag", Tag, false, "r.capture, r.id", "s.capture, j.run_id", "of the run or of its capture"},
    {"run", Text, true, "r.id", "j.run_id", "its name"},
    {"state", Text, true, "", "j.state", "queued leased done failed; without it, only what is done counts"},
    {"solver", Text, true, "r.solver", "p.solver", ""},
    {"recipe", Text, true, "j.recipe_id", "j.recipe_id", "fingerprint"},
    {"rig", Text, true, "r.rig_id", "j.rig_id", "fingerprint"},
    {"version", Text, true, "r.program_version", "j.program_version", "of the program"},
    {"worker", Text, true, "r.worker", "j.worker", ""},
    {"reason", Text, true, "j.reason", "j.reason", "of the last failure"},
    {"attempts", Number, true, "j.attempt", "j.attempt", ""},
    {"created", Time, true, "j.created_time_ns", "j.created_time_ns", "when it was asked for"},
    {"finished", Time, true, "r.finished_time_ns", "r.finished_time_ns", ""},
    {"inputs", Number, true, "r.inputs", "r.inputs", "sets that went in"},
    {"iterations", Number, true, "r.iterations", "r.iterations", ""},
    {"residual", Number, true, "r.residual", "r.residual", "|Ax - b| / |b|"},
    {"solve_s", Number, true, "r.solve_s", "r.solve_s", ""},
    {"queue_s", Number, true, "r.queue_s", "r.queue_s", ""},
    {"stale", Truth, true, kStale, kStale, "a newer accepted calibration counts for its pulse"},
    {"metric", Metric, true, "", "", "metric.NAME, e.g. metric.pearson_3d"},
}};

}  // namespace

std::span<const FilterField> filter_fields() {
  return kFields;
}

}  // namespace flamefield
