import { useState } from "preact/hooks";
import { get, type Run, type RunsPage } from "../api";
import { significant } from "../format";
import { useLoaded } from "../hooks";
import { Card, Empty, Loading, Problem, Time } from "../parts/basics";
import { Plot } from "../parts/plot";
import { type Rig, RingView } from "./ring-view";
import { Session } from "./session";
import { type Accepted, kVerdicts } from "./session-state";

// The rig that was accepted last, or else that of the newest run.
async function newestRig(signal: AbortSignal): Promise<{ rig: Rig; size_mm: number[] } | null> {
  const accepted = (await history(signal)).at(-1);
  if (accepted) return { rig: await get<Rig>(`rigs/${encodeURIComponent(accepted.rig_id)}`, signal), size_mm: [0, 0, 0] };
  const page = await get<RunsPage>("runs?limit=1", signal);
  if (page.runs.length === 0) return null;
  const run = await get<Run>(`runs/${encodeURIComponent(page.runs[0].id)}`, signal);
  const rig = await get<Rig>(`rigs/${encodeURIComponent(run.rig)}`, signal);
  return { rig, size_mm: run.size.map((n, i) => n * run.spacing_mm[i]) };
}

async function history(signal: AbortSignal): Promise<Accepted[]> {
  return (await get<{ calibrations: Accepted[] }>("calibrations", signal)).calibrations;
}

// Which calibration held when, and whether the ring drifts.
function History({ accepted }: { accepted: Accepted[] }) {
  return (
    <Card title="History and drift" class="wide">
      {accepted.length > 1 && <Plot label="Largest shift of a camera since the calibration before, and expected error, of each accepted calibration" x={accepted.map((_, i) => i)} names={accepted.map((a) => String(a.version))} xLabel="calibration" yLabel="in the volume (px)" fromZero curves={[
        { name: "largest shift since the one before", values: accepted.map((a) => a.worst_shift_px), colour: "--series1", bars: true }, { name: "expected error, worst camera", values: accepted.map((a) => a.volume_error_px.worst), colour: "--series2" },
      ]} />}
      <div class="scroll" tabIndex={0} role="region" aria-label="Accepted calibrations">
        <table>
          <thead><tr><th scope="col" class="n">Version</th><th scope="col">Accepted</th><th scope="col">By</th><th scope="col">Verdict</th><th scope="col" class="n">Poses</th><th scope="col" class="n">RMS (px)</th><th scope="col" class="n">Volume, worst (px)</th><th scope="col" class="n">Largest shift (px)</th><th scope="col">Moved since the one before</th><th scope="col">Note</th><th scope="col">Report</th></tr></thead>
          <tbody>{[...accepted].reverse().map((a) => (
            <tr key={a.version}><th scope="row" class="n">{a.version}</th><td><Time utc={new Date(a.accepted_time_ns / 1e6).toISOString()} /></td><td>{a.accepted_by}</td><td class={kVerdicts[a.verdict]?.class}>{kVerdicts[a.verdict]?.mark} {kVerdicts[a.verdict]?.text ?? a.verdict}</td>
              <td class="n">{a.poses}</td><td class="n">{significant(a.rms_px)}</td><td class="n">{significant(a.volume_error_px.worst)}</td><td class="n">{a.worst_shift_px === null ? "–" : `${significant(a.worst_shift_px)} (${a.most_shifted})`}</td><td>{a.predecessor === null ? "–" : a.moved_cameras.join(", ") || "none"}</td><td>{a.note}</td><td>{a.capture && <a href={`/calibrations/${encodeURIComponent(a.capture)}/report.html`} target="_blank" rel="noreferrer">report</a>}</td></tr>
          ))}</tbody>
        </table>
      </div>
    </Card>
  );
}

export function CalibrationPage() {
  const [turn, setTurn] = useState(0);
  const found = useLoaded(`rig ${turn}`, newestRig);
  const accepted = useLoaded(`history ${turn}`, history);
  return (
    <div class="calibration-page">
      <Session onAccepted={() => setTurn(turn + 1)} />
      {found.error && <Problem text={found.error} again={found.again} />}
      {found.loading && !found.value && <Loading what="calibration" />}
      {!found.loading && !found.error && !found.value && <Empty title="No calibration is in use yet.">Hold a session above, or show the board with flamefield capture board --pulses 24, solve it with flamefield calibrate solve, and start flamefield serve --rig rig.yaml.</Empty>}
      {accepted.value && accepted.value.length > 0 && <History accepted={accepted.value} />}
      {found.value && <InUse {...found.value} />}
    </div>
  );
}

function InUse({ rig, size_mm }: { rig: Rig; size_mm: number[] }) {
  const cameras = rig.cameras;
  const known = cameras.filter((c) => c.rms_px !== undefined);
  return (
    <>
      <Card title="Ring" aside={<span class="dim">rig {rig.id}</span>}>
        <RingView rig={rig} size_mm={size_mm} />
        <p class="note">{size_mm[0] > 0 ? "The box is the reconstructed volume." : "The cylinder is 60 mm wide and 80 mm high."} Pyramids show what a camera sees.</p>
      </Card>
      <Card title="Reprojection error by camera">
        {known.length > 0
          ? <Plot label={`Reprojection error of each camera, RMS ${significant(rig.rms_px)} px over all`} x={known.map((_, i) => i)} names={known.map((c) => c.name)} xLabel="camera" yLabel="RMS (px)" fromZero curves={[{ name: "RMS", values: known.map((c) => c.rms_px ?? 0), colour: "--series1", bars: true }]} />
          : <p class="note">This rig was not estimated from boards: nothing is known about its errors.</p>}
      </Card>
      <Card title="Cameras" class="wide">
        <div class="scroll" tabIndex={0} role="region" aria-label="Cameras of the rig">
          <table>
            <thead><tr><th scope="col">Camera</th><th scope="col" class="n">Boards</th><th scope="col" class="n">Corners</th><th scope="col" class="n">Left out</th><th scope="col" class="n">RMS (px)</th><th scope="col" class="n">σ position (mm)</th><th scope="col" class="n">σ rotation (mrad)</th><th scope="col" class="n">Focal length (px)</th><th scope="col" class="n">σ focal (px)</th><th scope="col" class="n">Position x, y, z (mm)</th></tr></thead>
            <tbody>
              {cameras.map((c) => (
                <tr key={c.name}><th scope="row">{c.name}</th><td class="n">{c.images ?? "–"}</td><td class="n">{c.corners ?? "–"}</td><td class="n">{c.rejected_corners ?? "–"}</td><td class="n">{significant(c.rms_px)}</td>
                  <td class="n">{significant(c.position_sigma_mm)}</td><td class="n">{significant(c.rotation_sigma_rad === undefined ? undefined : 1000 * c.rotation_sigma_rad)}</td><td class="n">{c.fx_px.toFixed(1)}</td><td class="n">{significant(c.focal_sigma_px)}</td><td class="n">{c.centre_mm.map((v) => v.toFixed(1)).join(", ")}</td></tr>
              ))}
            </tbody>
          </table>
        </div>
      </Card>
    </>
  );
}
