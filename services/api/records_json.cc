#include "services/api/records_json.h"

#include <nlohmann/json.hpp>

#include "services/api/recipe_json.h"

namespace flamefield {

using Json = nlohmann::ordered_json;

Json json_of(const RunRow& row) {
  const Run& run = row.run;
  Json inputs = Json::array();
  for (const SetId& id : run.inputs) inputs.push_back({{"capture", id.capture}, {"index", id.index}});
  return {{"id", run.id},
          {"inputs", std::move(inputs)},
          {"solver", run.solver},
          {"settings", settings_json_of(run.processing.recipe)},
          {"recipe", fingerprint(run.processing.recipe)},
          {"rig", run.processing.rig_id},
          {"program_version", run.program_version},
          {"worker", run.worker},
          {"volume", run.volume_path},
          {"volume_bytes", run.volume_bytes},
          {"volume_fingerprint", run.volume_fingerprint},
          {"projections", run.projections_path},
          {"iterations", run.iterations},
          {"residual", run.residual},
          {"residual_per_view", run.residual_per_view},
          {"stop_reason", run.stop_reason},
          {"projector_engine", run.projector_engine},
          {"metrics", run.metrics},
          {"provenance", run.provenance},
          {"queue_s", run.timings.queue_s},
          {"fetch_s", run.timings.fetch_s},
          {"prepare_s", run.timings.prepare_s},
          {"solve_s", run.timings.solve_s},
          {"write_s", run.timings.write_s},
          {"host", run.host},
          {"threads", run.threads},
          {"seed", run.seed},
          {"peak_rss_mib", run.peak_rss_mib},
          {"volume_sha256", run.volume_sha256},
          {"projections_sha256", run.projections_sha256},
          {"dark", run.processing.dark_capture},
          {"background", run.processing.background_capture},
          {"flat", run.processing.flat_capture},
          {"size", {run.processing.grid.nx, run.processing.grid.ny, run.processing.grid.nz}},
          {"spacing_mm",
           {run.processing.grid.spacing_mm.x(), run.processing.grid.spacing_mm.y(),
            run.processing.grid.spacing_mm.z()}},
          {"started", utc_text(run.started_time_ns)},
          {"finished", utc_text(run.finished_time_ns)}};
}

Json json_of(const std::vector<HistoryPoint>& history) {
  Json points = Json::array();
  for (const HistoryPoint& point : history) {
    Json entry = {
        {"iteration", point.iteration}, {"residual", point.residual}, {"elapsed_s", point.elapsed_s}};
    if (point.fitness != 0) {
      entry["fitness"] = point.fitness;
      entry["operator_success"] = point.operator_success;
    }
    points.push_back(std::move(entry));
  }
  return points;
}

Json json_of(const WorkRow& row) {
  Json json = json_of(RunRow{row.run, row.committed_time_ns});
  json["state"] = name_of(row.state);
  json["reason"] = row.reason;
  json["stale"] = row.stale;
  json["retired"] = row.retired;
  json["tags"] = row.tags;
  return json;
}

Json json_of(const Receipt& receipt) {
  Json cameras = Json::array();
  for (const auto& line : receipt.cameras) {
    cameras.push_back({{"camera", line.camera},
                       {"pulses", line.pulses},
                       {"frames", line.frames},
                       {"losses", line.losses},
                       {"counters", line.counters},
                       {"balances", line.balances()}});
  }
  Json failures = Json::array();
  for (const auto& failure : receipt.failures) {
    failures.push_back({{"run", failure.run_id}, {"reason", failure.reason}});
  }
  return {{"capture", receipt.capture.id},
          {"kind", name_of(receipt.capture.kind)},
          {"pulses", receipt.capture.pulses},
          {"pulses_wanted", receipt.capture.pulses_wanted},
          {"pre_pulses", receipt.capture.pre_pulses},
          {"end", name_of(receipt.capture.end)},
          {"end_reason", receipt.capture.end_reason},
          {"settings", receipt.capture.settings},
          {"sets", receipt.sets},
          {"sets_not_stored", receipt.sets_not_stored},
          {"volumes", receipt.volumes},
          {"failed", receipt.failed},
          {"pending", receipt.pending},
          {"not_asked", receipt.not_asked},
          {"combined_volumes", receipt.combined_volumes},
          {"cameras", std::move(cameras)},
          {"failures", std::move(failures)},
          {"balances", receipt.balances()}};
}

Json json_of(const CaptureRow& row) {
  return {{"capture", row.capture.id},
          {"kind", name_of(row.capture.kind)},
          {"started", utc_text(row.capture.started_time_ns)},
          {"finished", utc_text(row.capture.finished_time_ns)},
          {"pulses", row.capture.pulses},
          {"end", name_of(row.capture.end)},
          {"sets", row.sets},
          {"frames", row.frames},
          {"losses", row.losses}};
}

Json json_of(const CaptureState& state) {
  Json cameras = Json::array();
  for (const auto& camera : state.cameras) {
    cameras.push_back(
        {{"name", camera.name},
         {"address", camera.address},
         {"connected", camera.connected},
         {"frames", camera.frames},
         {"losses", camera.losses},
         {"counters", camera.counters},
         {"newest_age_s", camera.newest_age_s < 0 ? Json(nullptr) : Json(camera.newest_age_s)}});
  }
  return {{"phase", name_of(state.phase)},
          {"capture", state.id},
          {"kind", name_of(state.kind)},
          {"pulses_wanted", state.pulses_wanted},
          {"sets", state.sets},
          {"sets_stored", state.sets_stored},
          {"pre_pulses", state.pre_pulses},
          {"sets_held", state.sets_held},
          {"previews_skipped", state.previews_skipped},
          {"trouble", state.trouble},
          {"cameras", std::move(cameras)}};
}

Json json_of(const Status& status) {
  Json workers = Json::array(), waiting = Json::array();
  for (const auto& worker : status.workers) {
    workers.push_back({{"name", worker.name},
                       {"job", worker.job_id == 0 ? Json(nullptr) : Json(worker.job_id)},
                       {"silent_s", worker.silent_s},
                       {"host", worker.host},
                       {"threads", worker.threads},
                       {"cores", worker.cores},
                       {"memory_mib", worker.memory_mib}});
  }
  for (const auto& job : status.waiting) waiting.push_back({{"job", job.job_id}, {"why", job.why}});
  return {{"program_version", status.program_version},
          {"sets", status.sets},
          {"runs", status.runs},
          {"queued", status.queued},
          {"leased", status.leased},
          {"done", status.done},
          {"failed", status.failed},
          {"queued_by_priority", status.queued_by_priority},
          {"paused", status.paused},
          {"workers", std::move(workers)},
          {"waiting", std::move(waiting)},
          {"counters", status.counters}};
}

Json json_of(const Rig& rig, const std::string& id) {
  Json cameras = Json::array();
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const Camera& camera = rig.cameras[i];
    const Eigen::Vector3d centre = camera.centre_mm();
    const Eigen::Matrix3d world_from_camera = camera.camera_from_world.rotation.transpose();
    const Eigen::Vector3d axis = world_from_camera.col(2), up = -world_from_camera.col(1);
    Json json = {{"name", camera.name},
                 {"width_px", camera.image_width_px},
                 {"height_px", camera.image_height_px},
                 {"fx_px", camera.fx_px},
                 {"fy_px", camera.fy_px},
                 {"centre_mm", {centre.x(), centre.y(), centre.z()}},
                 {"axis", {axis.x(), axis.y(), axis.z()}},
                 {"up", {up.x(), up.y(), up.z()}}};
    if (rig.quality && i < rig.quality->cameras.size()) {
      const CameraQuality& quality = rig.quality->cameras[i];
      json["images"] = quality.images;
      json["corners"] = quality.corners;
      json["rejected_corners"] = quality.rejected_corners;
      json["rms_px"] = quality.rms_px;
      json["position_sigma_mm"] = quality.position_sigma_mm;
      json["rotation_sigma_rad"] = quality.rotation_sigma_rad;
      json["focal_sigma_px"] = quality.focal_sigma_px;
    }
    cameras.push_back(std::move(json));
  }
  return {{"id", id},
          {"rms_px", rig.quality ? Json(rig.quality->rms_px) : Json(nullptr)},
          {"board_poses", rig.quality ? Json(rig.quality->board_poses) : Json(nullptr)},
          {"cameras", std::move(cameras)}};
}

}  // namespace flamefield
