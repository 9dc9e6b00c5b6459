#include "services/api/prometheus.h"

#include <algorithm>
#include <cmath>
#include <string_view>

namespace flamefield {

namespace {

// One family after the other; each metric belongs to the family begun last.
class Exposition {
 public:
  void family(std::string_view name, std::string_view type, std::string_view help) {
    name_ = concat("flamefield_", name);
    text_ += concat("# HELP ", name_, " ", help, "\n# TYPE ", name_, " ", type, "\n");
  }
  template <class Value>
  void sample(const Value& value, std::string_view labels = {}) {
    text_ += labels.empty() ? concat(name_, " ", value, "\n") : concat(name_, "{", labels, "} ", value, "\n");
  }
  template <class Value>
  void single(std::string_view name, std::string_view type, std::string_view help, const Value& value) {
    family(name, type, help);
    sample(value);
  }
  std::string take() { return std::move(text_); }

 private:
  std::string name_, text_;
};

std::string label(std::string_view key, std::string_view value) {
  std::string out = concat(key, "=\"");
  for (char c : value) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

void add_array(const CaptureState& array, Exposition& out) {
  out.single("capturing", "gauge", "1 while a capture is under way", is_capturing(array.phase) ? 1 : 0);
  out.single("sets_assembled_total", "counter", "Frame sets of the capture", array.sets);
  out.single("sets_stored_total", "counter", "Of these, acknowledged as durable", array.sets_stored);
  out.family("camera_connected", "gauge", "0 while a camera does not deliver");
  for (const auto& camera : array.cameras) out.sample(camera.connected ? 1 : 0, label("camera", camera.name));
  out.family("camera_frames_total", "counter", "Frames of the capture that a camera delivered");
  for (const auto& camera : array.cameras) out.sample(camera.frames, label("camera", camera.name));
  out.family("camera_losses_total", "counter", "Pulses without a frame of a camera, by cause");
  for (const auto& camera : array.cameras) {
    for (const auto& [cause, count] : camera.losses)
      out.sample(count, concat(label("camera", camera.name), ",", label("cause", cause)));
  }
  out.family("camera_events_total", "counter",
             "Frames that came and are in no set (late, duplicate, extra, ...), and other events, by name");
  for (const auto& camera : array.cameras) {
    for (const auto& [name, count] : camera.counters)
      out.sample(count, concat(label("camera", camera.name), ",", label("event", name)));
  }
  out.single("sets_waiting", "gauge", "Frame sets that are not yet durable", array.sets - array.sets_stored);
  out.single("sets_held", "gauge", "Frame sets that standby keeps in memory", array.sets_held);
  out.single("previews_skipped_total", "counter",
             "Frames that no preview showed, so that recording goes first", array.previews_skipped);
  out.single("capture_in_trouble", "gauge", "1 while storing does not keep up, or has ended a capture",
             array.trouble.empty() ? 0 : 1);
  out.family("camera_newest_age_seconds", "gauge", "Since the newest frame of a camera");
  for (const auto& camera : array.cameras) {
    if (camera.newest_age_s >= 0) out.sample(camera.newest_age_s, label("camera", camera.name));
  }
}

void add_dispatcher(const Status& status, Exposition& out) {
  out.family("build_info", "gauge", "Always 1; the version is in the label");
  out.sample(1, label("version", status.program_version));
  out.single("sets_in_ledger", "gauge", "Frame sets that the ledger knows", status.sets);
  out.single("runs_in_ledger", "gauge", "Reconstructions that the ledger knows", status.runs);
  out.family("jobs", "gauge", "Jobs by state");
  out.sample(status.queued, label("state", "queued"));
  out.sample(status.leased, label("state", "leased"));
  out.sample(status.done, label("state", "done"));
  out.sample(status.failed, label("state", "failed"));
  out.single("workers", "gauge", "Workers that talk to the dispatcher", status.workers.size());
  out.family("dispatcher_events_total", "counter", "What the dispatcher counts since it started");
  for (const auto& [name, count] : status.counters) out.sample(count, label("event", name));
}

// The nearest rank: no figure that was not measured.
void add_quantiles(const std::vector<double>& sorted, const std::string& labels, Exposition& out) {
  if (sorted.empty()) return;
  for (const auto& [name, q] :
       {std::pair("0.5", 0.5), std::pair("0.9", 0.9), std::pair("0.99", 0.99), std::pair("1", 1.0)}) {
    const auto rank = static_cast<std::size_t>(std::ceil(q * static_cast<double>(sorted.size())));
    out.sample(sorted[std::clamp<std::size_t>(rank, 1, sorted.size()) - 1],
               concat(labels, labels.empty() ? "" : ",", label("quantile", name)));
  }
}

void add_ledger(const LedgerFigures& ledger, Exposition& out) {
  out.family("queue_jobs", "gauge", "Jobs by priority and state");
  for (const auto& [key, count] : ledger.jobs)
    out.sample(count,
               concat(label("priority", name_of(key.first)), ",", label("state", name_of(key.second))));
  out.single("queue_oldest_age_seconds", "gauge", "Of the job that waits longest; 0: none waits",
             ledger.oldest_waiting_s);
  out.family("pulse_to_volume_seconds", "gauge", "From the trigger to the volume, of the newest live runs");
  add_quantiles(ledger.pulse_to_volume_s, "", out);
  out.family("set_to_stored_seconds", "gauge",
             "From the last frame of a set until it was durable, of the newest sets");
  add_quantiles(ledger.set_to_stored_s, "", out);
  out.family("run_stage_seconds", "gauge", "What each stage of the newest runs took");
  for (const auto& [stage, values] : ledger.stage_s) add_quantiles(values, label("stage", stage), out);
  out.family("schedule_runs_total", "counter", "Due times of schedules by what became of them");
  for (const auto& [outcome, count] : ledger.schedule_outcomes) out.sample(count, label("outcome", outcome));
  out.single("artefacts", "gauge", "Files of runs", ledger.artefacts);
  out.single("artefact_bytes", "gauge", "Their size", ledger.artefact_bytes);
  out.single("artefacts_retired", "gauge", "Files of runs that were removed, and can be made again",
             ledger.retired);
}

void add_machine(const MachineFigures& machine, Exposition& out) {
  out.single("disk_free_bytes", "gauge", "Below the data directory", machine.disk_free_bytes);
  out.single("disk_bytes", "gauge", "Size of that disk", machine.disk_bytes);
  out.single("spool_bytes", "gauge", "Segments of raw sets", machine.spool_bytes);
  out.single("process_resident_bytes", "gauge", "Memory of the process that answers", machine.resident_bytes);
  out.single("process_cpu_seconds_total", "counter", "Processor time of the process that answers",
             machine.cpu_s);
  out.single("process_open_files", "gauge", "File descriptors of the process that answers",
             machine.open_files);
}

}  // namespace

std::string prometheus_text(const std::optional<LedgerFigures>& ledger, const MachineFigures& machine) {
  Exposition out;
  if (ledger) add_ledger(*ledger, out);
  add_machine(machine, out);
  return out.take();
}

std::string prometheus_text(const std::optional<CaptureState>& array, const std::optional<Status>& status) {
  Exposition out;
  out.family("up", "gauge", "1 when the service answers");
  out.sample(array ? 1 : 0, label("service", "acquisition"));
  out.sample(status ? 1 : 0, label("service", "dispatcher"));
  if (array) add_array(*array, out);
  if (status) add_dispatcher(*status, out);
  return out.take();
}

}  // namespace flamefield
