import { useEffect, useRef, useState } from "preact/hooks";
import { type Field, get, getField, type RunLine, type RunsPage } from "../api";
import { bytes } from "../format";
import { useInterval, useLoaded } from "../hooks";
import { Card, Empty, Loading, Problem } from "../parts/basics";
import { kFirstLook, type Look } from "../volume/look";
import { ColourBar, Slices } from "../volume/slices";
import { LookControls, VolumeView } from "../volume/volume-view";

const kKept = 400; // volumes in memory; longer bursts are thinned out

// One run of each pulse: of the solver that has most of them, the newest.
function oneEach(runs: RunLine[]): RunLine[] {
  const tally = new Map<string, number>();
  for (const run of runs) if (run.inputs === 1) tally.set(run.solver, (tally.get(run.solver) ?? 0) + 1);
  const solver = [...tally].sort((a, b) => b[1] - a[1])[0]?.[0];
  const byPulse = new Map<number, RunLine>();
  for (const run of runs) {
    if (run.inputs !== 1 || run.solver !== solver) continue;
    const known = byPulse.get(run.index);
    if (!known || run.finished > known.finished) byPulse.set(run.index, run);
  }
  return [...byPulse.values()].sort((a, b) => a.index - b.index);
}

async function runsOf(capture: string, signal: AbortSignal): Promise<RunLine[]> {
  const all: RunLine[] = [];
  for (;;) {
    const page = await get<RunsPage>(`runs?capture=${encodeURIComponent(capture)}&sort=capture&order=asc&limit=1000&offset=${all.length}`, signal);
    all.push(...page.runs);
    if (all.length >= page.total || page.runs.length === 0 || all.length >= 20_000) break;
  }
  const each = oneEach(all);
  const step = Math.ceil(each.length / kKept);
  return each.filter((_, i) => i % step === 0);
}

export function FilmPage({ capture }: { capture: string }) {
  const runs = useLoaded(capture, (signal) => runsOf(capture, signal));
  const fields = useRef<(Field | null)[]>([]);
  const [loaded, setLoaded] = useState(0);
  const [at, setAt] = useState(0);
  const [playing, setPlaying] = useState(true);
  const [rate_hz, setRate] = useState(5);
  const [look, setLook] = useState<Look>(kFirstLook);
  useEffect(() => {
    if (!runs.value) return undefined;
    const stop = new AbortController();
    fields.current = runs.value.map(() => null);
    const load = async () => {
      for (const [i, run] of (runs.value ?? []).entries()) {
        if (stop.signal.aborted) return;
        fields.current[i] = await getField(run.id, 8, 96, stop.signal).catch(() => null);
        setLoaded(i + 1);
      }
    };
    void load();
    return () => stop.abort();
  }, [runs.value]);
  const all = runs.value?.length ?? 0;
  const step = (by: number) => all > 0 && setAt((now) => (now + by + all) % all);
  useInterval(1000 / rate_hz, () => {
    if (!playing || all === 0) return;
    const next = (at + 1) % all;
    if (next < loaded) setAt(next);
    else if (loaded > 1) setAt(0);
  });
  if (runs.error) return <Problem text={runs.error} again={runs.again} />;
  if (!runs.value) return <Loading what="burst" />;
  if (all === 0) return <Empty title="No film">{capture} has no volumes of single pulses. <a href="#/runs">All runs</a></Empty>;
  const field = fields.current[at] ?? fields.current.find((f) => f) ?? null;
  const high = Math.max(...fields.current.slice(0, loaded).map((f) => f?.head.high ?? 0), 1e-12);
  const head = field?.head;
  const first = fields.current[0]?.head.pulse_time_ns ?? 0;
  return (
    <div class="film-page">
      <div class="bar"><h2 class="long">{capture}</h2><a href="#/runs">all runs</a><span class="grow" /><span class="dim" role="status">{loaded < all ? `${loaded} of ${all} volumes loaded` : `${all} volumes`}{head ? ` (${bytes(loaded * head.size[0] * head.size[1] * head.size[2])})` : ""}</span></div>
      <Card title="Volume" aside={<ColourBar low={0} high={high} />}>
        <VolumeView field={field} low={0} high={high} look={look} label="The flame, pulse by pulse" />
        <LookControls look={look} set={setLook} high={high} />
      </Card>
      <Card title="Slices"><Slices field={field} low={0} high={high} /></Card>
      <div class="card player">
        <button type="button" class="primary" onClick={() => setPlaying(!playing)}>{playing ? "❚❚ Pause" : "▶ Play"}</button>
        <button type="button" aria-label="one pulse back" onClick={() => { setPlaying(false); step(-1); }}>◀</button>
        <button type="button" aria-label="one pulse on" onClick={() => { setPlaying(false); step(1); }}>▶</button>
        <input type="range" class="grow" aria-label="pulse" min={0} max={all - 1} value={at} onInput={(e) => { setPlaying(false); setAt(Number(e.currentTarget.value)); }} />
        <span class="number">pulse {runs.value[at].index + 1}{head && first ? `, ${((head.pulse_time_ns - first) / 1e9).toFixed(2)} s` : ""}</span>
        <label>Rate <select value={rate_hz} onChange={(e) => setRate(Number(e.currentTarget.value))}>{[1, 2, 5, 10].map((r) => <option key={r} value={r}>{r} Hz</option>)}</select></label>
        <a href={`#/runs/${encodeURIComponent(runs.value[at].id)}`}>this run</a>
      </div>
    </div>
  );
}
