import { useMemo, useState } from "preact/hooks";
import { type Field, get, getField, type Run } from "../api";
import { duration, significant } from "../format";
import { useLoaded } from "../hooks";
import { Card, Empty, Loading, Problem } from "../parts/basics";
import { Plot } from "../parts/plot";
import { kFirstLook, type Look, meanByHeight } from "../volume/look";
import { ColourBar, Slices } from "../volume/slices";
import { Linked, LookControls, VolumeView } from "../volume/volume-view";

const same = (a: number[], b: number[]) => a.every((value, i) => Math.abs(value - b[i]) < 1e-9 * (1 + Math.abs(value)));

export interface Comparison {
  difference: Field;
  pearson: number;
  rmse: number;
  largest: number;
}

// Right minus left, voxel by voxel; null when the grids differ.
export function compared(left: Field, right: Field): Comparison | null {
  if (!same(left.head.size, right.head.size) || !same(left.head.spacing_mm, right.head.spacing_mm) || !same(left.head.origin_mm, right.head.origin_mm)) return null;
  const n = left.values.length;
  const values = new Float32Array(n);
  let meanL = 0;
  let meanR = 0;
  for (let i = 0; i < n; ++i) {
    meanL += left.values[i] / n;
    meanR += right.values[i] / n;
  }
  let ll = 0;
  let rr = 0;
  let lr = 0;
  let squares = 0;
  let largest = 0;
  for (let i = 0; i < n; ++i) {
    const l = left.values[i] - meanL;
    const r = right.values[i] - meanR;
    ll += l * l;
    rr += r * r;
    lr += l * r;
    values[i] = right.values[i] - left.values[i];
    squares += values[i] * values[i];
    largest = Math.max(largest, Math.abs(values[i]));
  }
  return {
    difference: { head: { ...left.head, run: "difference", low: -largest, high: largest }, values },
    pearson: ll > 0 && rr > 0 ? lr / Math.sqrt(ll * rr) : NaN,
    rmse: Math.sqrt(squares / n),
    largest,
  };
}

type Both = { runs: [Run, Run]; fields: [Field, Field] };

export function ComparePage({ left, right }: { left: string; right: string }) {
  const both = useLoaded<Both | null>(`${left} ${right}`, async (signal) => {
    if (!left || !right) return null;
    const [a, b, fa, fb] = await Promise.all([
      get<Run>(`runs/${encodeURIComponent(left)}`, signal), get<Run>(`runs/${encodeURIComponent(right)}`, signal),
      getField(left, 16, 128, signal), getField(right, 16, 128, signal),
    ]);
    return { runs: [a, b], fields: [fa, fb] };
  });
  const linked = useMemo(() => new Linked(), []);
  const [look, setLook] = useState<Look>(kFirstLook);
  const comparison = useMemo(() => (both.value ? compared(...both.value.fields) : null), [both.value]);
  if (!left || !right) return <Empty title="Nothing to compare">Tick two runs <a href="#/runs">in the table</a>.</Empty>;
  if (both.error) return <Problem text={both.error} again={both.again} />;
  if (!both.value) return <Loading what="both runs" />;
  const { runs, fields } = both.value;
  const high = Math.max(fields[0].head.high, fields[1].head.high);
  const profiles = fields.map(meanByHeight);
  const keys = [...new Set([...Object.keys(runs[0].settings), ...Object.keys(runs[1].settings)])].sort();
  const facts: [string, (run: Run) => string][] = [
    ["Solver", (r) => `${r.solver}, ${r.iterations} iterations`],
    ["Residual (1)", (r) => significant(r.residual, 4)],
    ["Solve time", (r) => duration(r.solve_s)],
    ["Inputs", (r) => (r.inputs.length === 1 ? `${r.inputs[0].capture}, pulse ${r.inputs[0].index + 1}` : `mean of ${r.inputs.length} sets`)],
    ["Rig", (r) => r.rig],
    ["Version", (r) => r.program_version],
    ...keys.map((key): [string, (run: Run) => string] => [key, (r) => String(r.settings[key] ?? "default")]),
  ];
  return (
    <div class="compare-page">
      <div class="bar"><h2>Compare</h2><a href="#/runs">all runs</a><span class="grow" /><LookControls look={look} set={setLook} high={high} /></div>
      {fields.map((field, i) => (
        <Card key={i} title={i === 0 ? "Left" : "Right"} aside={<a class="long" href={`#/runs/${encodeURIComponent(runs[i].id)}`}>{runs[i].id}</a>}>
          <VolumeView field={field} low={0} high={high} look={look} linked={linked} label={`Volume of ${runs[i].id}`} />
          <ColourBar low={0} high={high} />
          <Slices field={field} low={0} high={high} />
        </Card>
      ))}
      <Card title="Right − left" aside={comparison && <span class="dim">Pearson {comparison.pearson.toFixed(4)} · RMSE {significant(comparison.rmse)} · at most {significant(comparison.largest)}</span>}>
        {comparison ? <>
          <VolumeView field={comparison.difference} low={-comparison.largest} high={comparison.largest} look={{ ...look, map: "difference", mode: look.mode === "brightest" ? "glow" : look.mode }} linked={linked} label="Difference of the two volumes" />
          <ColourBar low={-comparison.largest} high={comparison.largest} map="difference" />
          <Slices field={comparison.difference} low={-comparison.largest} high={comparison.largest} map="difference" />
        </> : <Empty title="No difference volume">The two have different grids.</Empty>}
      </Card>
      <Card title="What differs" class="half">
        <div class="scroll" tabIndex={0} role="region" aria-label="Settings and results of both runs">
          <table>
            <thead><tr><th scope="col">What</th><th scope="col">Left</th><th scope="col">Right</th></tr></thead>
            <tbody>{facts.map(([name, text]) => {
              const [a, b] = runs.map(text);
              return <tr key={name} class={a === b ? "dim" : ""}><th scope="row">{name}</th><td>{a}</td><td>{a === b ? "same" : b}</td></tr>;
            })}</tbody>
          </table>
        </div>
      </Card>
      <Card title="Mean emission by height" class="half">
        {same(profiles[0].height_mm, profiles[1].height_mm) && <Plot label="Mean emission against height of both runs" x={profiles[0].height_mm} xLabel="HAB y (mm)" yLabel="mean emission (a.u.)" fromZero height={240} curves={[
          { name: "left", values: profiles[0].mean, colour: "--series1" }, { name: "right", values: profiles[1].mean, colour: "--series2", dash: [6, 4] },
        ]} />}
      </Card>
    </div>
  );
}
