import { useState } from "preact/hooks";
import { type Field, type FrameHead, get, getField, getMessage, type Receipt, type Run, type ThumbnailsHead } from "../api";
import { maps } from "../colour";
import { bytes, count, duration, significant } from "../format";
import { useLoaded } from "../hooks";
import { FrameView, levelsOf } from "../live/large-view";
import { drawValues } from "../live/pixels";
import { Card, Empty, Facts, Loading, Problem, Time } from "../parts/basics";
import { Plot } from "../parts/plot";
import { kFirstLook, type Look, meanByHeight } from "../volume/look";
import { ColourBar, Slices } from "../volume/slices";
import { LookControls, VolumeView } from "../volume/volume-view";
import { Reprocess } from "./reprocess";

export function ReceiptTable({ receipt }: { receipt: Receipt }) {
  const causes = [...new Set(receipt.cameras.flatMap((c) => Object.keys(c.losses)))].sort();
  return (
    <>
      <p class={receipt.balances ? "good" : "poor"}>{receipt.balances ? "✓ Balanced: " : "✗ Not balanced: "}
        {count(receipt.sets)} sets = {count(receipt.volumes)} volumes + {receipt.failed} failed + {receipt.pending} pending + {receipt.not_asked} not asked for, of {count(receipt.pulses)} pulses.</p>
      <div class="scroll" tabIndex={0} role="region" aria-label="Receipt by camera">
        <table>
          <thead><tr><th scope="col">Camera</th><th scope="col" class="n">Pulses</th><th scope="col" class="n">Frames</th>{causes.map((cause) => <th scope="col" class="n" key={cause}>{cause}</th>)}<th scope="col">Balance</th></tr></thead>
          <tbody>
            {receipt.cameras.map((c) => (
              <tr key={c.camera}><th scope="row">{c.camera}</th><td class="n">{count(c.pulses)}</td><td class="n">{count(c.frames)}</td>
                {causes.map((cause) => <td class="n" key={cause}>{c.losses[cause] ?? 0}</td>)}<td class={c.balances ? "good" : "poor"}>{c.balances ? "✓" : "✗"}</td></tr>
            ))}
          </tbody>
        </table>
      </div>
    </>
  );
}

function Images({ capture, index }: { capture: string; index: number }) {
  const set = useLoaded(`${capture} ${index}`, (signal) => getMessage<ThumbnailsHead>(`captures/${encodeURIComponent(capture)}/sets/${index}`, signal));
  const [chosen, choose] = useState("");
  const frame = useLoaded(`${capture} ${index} ${chosen}`, async (signal) =>
    chosen ? levelsOf(await getMessage<FrameHead>(`captures/${encodeURIComponent(capture)}/sets/${index}/frames/${encodeURIComponent(chosen)}`, signal)) : null);
  if (set.error) return <Problem text={set.error} again={set.again} />;
  if (!set.value) return <Loading what="images" />;
  const { head, payload } = set.value;
  return (
    <>
      {head.losses.length > 0 && <p class="poor">✗ Without a frame: {head.losses.map((loss) => `${loss.camera} (${loss.cause})`).join(", ")}</p>}
      <div class="thumbnails small">
        {head.cameras.map((camera) => (
          <button type="button" class="thumbnail" key={camera.name} aria-pressed={camera.name === chosen} onClick={() => choose(camera.name === chosen ? "" : camera.name)}>
            <canvas class="picture" role="img" aria-label={`frame of ${camera.name}`} ref={(canvas) => {
              if (canvas) drawValues(canvas, payload.subarray(camera.offset, camera.offset + camera.width * camera.height), camera.width, camera.height, 0, 255, maps.inferno, 255);
            }} />
            <span class="line"><strong>{camera.name}</strong><span class="dim">max {camera.max}</span></span>
          </button>
        ))}
      </div>
      {frame.error && <Problem text={frame.error} />}
      {chosen && frame.value && <FrameView levels={frame.value} map="inferno" stretch={false} />}
    </>
  );
}

export function Volume3D({ field, low = 0, map }: { field: Field; low?: number; map?: Look["map"] }) {
  const [look, setLook] = useState<Look>({ ...kFirstLook, map: map ?? "inferno" });
  const [turning, setTurning] = useState(false);
  return (
    <>
      <VolumeView field={field} low={low} high={field.head.high} look={look} turning={turning} label="Volume in 3D" />
      <LookControls look={look} set={setLook} high={field.head.high} turning={turning} setTurning={setTurning} />
    </>
  );
}

export function RunPage({ id }: { id: string }) {
  const run = useLoaded<Run>(id, (signal) => get(`runs/${encodeURIComponent(id)}`, signal));
  const field = useLoaded<Field>(id, (signal) => getField(id, 16, 160, signal));
  const capture = run.value?.inputs[0]?.capture ?? "";
  const receipt = useLoaded<Receipt | null>(capture, async (signal) => (capture ? get<Receipt>(`captures/${encodeURIComponent(capture)}/receipt`, signal) : null));
  const [reprocessing, setReprocessing] = useState(false);
  if (run.error) return <><Problem text={run.error} again={run.again} /><Empty title="No such run"><a href="#/runs">All runs</a></Empty></>;
  if (!run.value) return <Loading what="run" />;
  const r = run.value;
  const views = Object.entries(r.residual_per_view);
  const profile = field.value ? meanByHeight(field.value) : null;
  const settings = Object.entries(r.settings);
  const download = `/${r.volume}`;
  return (
    <div class="run-page">
      <div class="bar">
        <h2 class="long">{r.id}</h2>
        <span class="grow" />
        <a class="button" href={download} download="">↓ Volume ({bytes(r.volume_bytes)})</a>
        <a class="button" href={`/api/v1/runs/${encodeURIComponent(r.id)}`} download={`${r.id}.json`}>↓ Record</a>
        <a class="button" href={`#/film/${encodeURIComponent(capture)}`}>▶ Film of this burst</a>
        <button type="button" onClick={() => setReprocessing(true)}>Reprocess …</button>
      </div>
      <Card title="Volume" class="volume" aside={field.value && <ColourBar low={0} high={field.value.head.high} />}>
        {field.error && <Problem text={field.error} again={field.again} />}
        {field.value ? <Volume3D field={field.value} /> : !field.error && <Loading what="volume" />}
      </Card>
      <Card title="Slices" class="side">
        {field.value && <Slices field={field.value} low={0} high={field.value.head.high} />}
        <p class="note">Axes in mm; y is the height above the burner (HAB). One scale for all.</p>
      </Card>
      <Card title="Mean emission by height">
        {profile && <Plot label="Mean emission of each horizontal layer against the height above the burner" x={profile.height_mm} xLabel="HAB y (mm)" yLabel="mean emission (a.u.)" fromZero curves={[{ name: "mean", values: profile.mean, colour: "--series2" }]} height={230} />}
      </Card>
      <Card title="Residual by view">
        {views.length ? <Plot label={`Residual of each view, from ${significant(Math.min(...views.map((v) => v[1])))} to ${significant(Math.max(...views.map((v) => v[1])))}`} x={views.map((_, i) => i)} names={views.map((v) => v[0])} xLabel="camera" yLabel="|Ax − b| / |b|  (1)" fromZero curves={[{ name: "residual", values: views.map((v) => v[1]), colour: "--series1", bars: true }]} height={230} /> : <p class="note">Not recorded.</p>}
      </Card>
      {r.history.length > 1 && <Card title="Residual by iteration">
        <Plot label={`Residual against iteration, from ${significant(r.history[0].residual)} to ${significant(r.history[r.history.length - 1].residual)}`} x={r.history.map((h) => h.iteration)} xLabel="iteration" yLabel="|Ax − b| / |b|  (1)" fromZero curves={[{ name: "residual", values: r.history.map((h) => h.residual), colour: "--series2" }]} height={230} />
      </Card>}
      <Card title="How it was made">
        <Facts rows={[
          ["Solver", `${r.solver}, ${count(r.iterations)} iterations (${r.stop_reason})`],
          ["Residual", `${significant(r.residual, 4)} (|Ax − b| / |b|)`],
          ...Object.entries(r.metrics).map(([name, value]): [string, string] => [name, significant(value, 4)]),
          ["Grid", `${r.size.join(" × ")} voxels of ${r.spacing_mm.map((s) => significant(s)).join(" × ")} mm`],
          ["Inputs", r.inputs.length === 1 ? `${capture}, pulse ${r.inputs[0].index + 1}` : `mean of ${r.inputs.length} sets of ${capture}`],
          ["References", [r.dark && `dark ${r.dark}`, r.background && `background ${r.background}`, r.flat && `flat ${r.flat}`].filter(Boolean).join(", ") || "none"],
          ["Settings", settings.length ? settings.map(([key, value]) => <div key={key}><code>{key} = {String(value)}</code></div>) : "all at their defaults"],
          ["Recipe, rig", <code>{r.recipe}, {r.rig}</code>],
          ["Finished", <Time utc={r.finished} />],
          ["Time", `${duration(r.queue_s)} queue, ${duration(r.fetch_s)} fetch, ${duration(r.prepare_s)} prepare, ${duration(r.solve_s)} solve, ${duration(r.write_s)} write`],
          ["Worker", `${r.worker}, flamefield ${r.program_version}`],
          ["Projector", r.projector_engine],
          ["Fingerprint", <code>{r.volume_fingerprint}</code>],
        ]} />
        {r.provenance.length > 0 && <details><summary>Preparation steps ({r.provenance.length})</summary><ol>{r.provenance.map((line) => <li key={line}>{line}</li>)}</ol></details>}
      </Card>
      <Card title={`Receipt of ${capture}`}>
        {receipt.error && <Problem text={receipt.error} again={receipt.again} />}
        {receipt.value && <ReceiptTable receipt={receipt.value} />}
      </Card>
      <Card title="Images" class="wide">
        {r.inputs[0] && <Images capture={capture} index={r.inputs[0].index} />}
      </Card>
      {reprocessing && <Reprocess runs={[{ id: r.id, capture, index: r.inputs[0]?.index ?? 0, inputs: r.inputs.length, solver: r.solver, worker: r.worker, rig: r.rig, iterations: r.iterations, residual: r.residual, volume_bytes: r.volume_bytes, duration_s: r.solve_s, finished: r.finished }]} onClose={() => setReprocessing(false)} onDone={() => {}} />}
    </div>
  );
}
