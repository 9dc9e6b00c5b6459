import { useEffect, useRef, useState } from "preact/hooks";
import type { Field } from "../api";
import { maps, type MapName } from "../colour";
import { significant } from "../format";
import { drawValues } from "../live/pixels";
import { type AxisName, sliceOf } from "./look";

const kAxes: AxisName[] = ["x", "y", "z"];
const kNames = { x: "x", y: "HAB y", z: "z" };

function SliceCanvas({ field, normal, index, low, high, map }: { field: Field; normal: AxisName; index: number; low: number; high: number; map: MapName }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [at, setAt] = useState<{ right: number; up: number; value: number } | null>(null);
  const slice = sliceOf(field, normal, index);
  const number = { x: 0, y: 1, z: 2 };
  useEffect(() => {
    if (canvas.current) drawValues(canvas.current, slice.values, slice.width, slice.height, low, high, maps[map]);
  }, [field, index, low, high, map]);
  const side = (axis: AxisName) => field.head.spacing_mm[number[axis]];
  const point = (event: MouseEvent) => {
    const box = (event.currentTarget as HTMLElement).getBoundingClientRect();
    const column = Math.min(slice.width - 1, Math.floor(((event.clientX - box.left) / box.width) * slice.width));
    const row = Math.min(slice.height - 1, Math.floor(((event.clientY - box.top) / box.height) * slice.height));
    if (column < 0 || row < 0) return;
    const origin = field.head.origin_mm;
    setAt({
      right: origin[number[slice.right]] + column * side(slice.right),
      up: origin[number[slice.up]] + (slice.height - 1 - row) * side(slice.up),
      value: slice.values[row * slice.width + column],
    });
  };
  return (
    <figure>
      <canvas ref={canvas} class="slice" role="img" aria-label={`slice normal to ${normal} at ${slice.position_mm.toFixed(1)} mm`}
        style={{ aspectRatio: `${slice.width * side(slice.right)} / ${slice.height * side(slice.up)}` }} onMouseMove={point} onMouseLeave={() => setAt(null)} />
      <figcaption>
        <span>{kNames[normal]} = {slice.position_mm.toFixed(1)} mm</span>
        <span class="dim">{at ? `${slice.right} ${at.right.toFixed(1)}, ${slice.up} ${at.up.toFixed(1)} mm: ${significant(at.value)}` : `→ ${kNames[slice.right]}, ↑ ${kNames[slice.up]}`}</span>
      </figcaption>
    </figure>
  );
}

// Three cuts through a field, each with its slider, to one scale.
export function Slices({ field, low, high, map = "inferno", onDrawn }: { field: Field | null; low: number; high: number; map?: MapName; onDrawn?: (field: Field) => void }) {
  const [shares, setShares] = useState<Record<AxisName, number>>({ x: 0.5, y: 0.5, z: 0.5 });
  useEffect(() => {
    if (field) onDrawn?.(field);
  }, [field]);
  if (!field) return <div class="slices"><div class="over still">Slices appear with the first volume.</div></div>;
  return (
    <div class="slices">
      {kAxes.map((axis, i) => {
        const layers = field.head.size[i];
        const index = Math.min(layers - 1, Math.floor(shares[axis] * layers));
        return (
          <div key={axis}>
            <SliceCanvas field={field} normal={axis} index={index} low={low} high={high} map={map} />
            <input type="range" aria-label={`position of the slice along ${axis}`} min={0} max={layers - 1} step={1} value={index}
              onInput={(e) => setShares({ ...shares, [axis]: (Number(e.currentTarget.value) + 0.5) / layers })} />
          </div>
        );
      })}
    </div>
  );
}

export function ColourBar({ low, high, map = "inferno", unit = "a.u." }: { low: number; high: number; map?: MapName; unit?: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    if (canvas.current) drawValues(canvas.current, Float32Array.from({ length: 256 }, (_, i) => i), 256, 1, 0, 255, maps[map]);
  }, [map]);
  return <div class="colour-bar"><span>{significant(low)}</span><canvas ref={canvas} aria-hidden="true" /><span>{significant(high)} {unit}</span></div>;
}
