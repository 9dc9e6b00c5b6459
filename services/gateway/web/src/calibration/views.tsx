import { useRef, useState } from "preact/hooks";
import type { Message, ThumbnailsHead } from "../api";
import { maps } from "../colour";
import { useTopic } from "../hooks";
import { LiveFrame } from "../live/large-view";
import { drawValues } from "../live/pixels";
import { Card } from "../parts/basics";
import type { SessionCamera, SessionState } from "./session-state";

// The corners found in the newest picture, and the nine fields that corners should reach.
function Corners({ camera, width, height, dot }: { camera: SessionCamera; width: number; height: number; dot: number }) {
  const corners = [];
  for (let i = 0; i + 1 < camera.corners_px.length; i += 2) corners.push(`M${camera.corners_px[i] + 0.5} ${camera.corners_px[i + 1] + 0.5}h0`);
  const [left = 0, top = 0, wide = 0, high = 0] = camera.region_px;
  return (
    <svg viewBox={`0 0 ${width} ${height}`} preserveAspectRatio="none" aria-hidden="true">
      {wide > 0 && camera.covered.map((covered, i) => (
        <rect key={i} x={left + ((i % 3) * wide) / 3} y={top + (Math.floor(i / 3) * high) / 3} width={wide / 3} height={high / 3} class={covered ? "covered" : "open"} />
      ))}
      <path d={corners.join("")} class="corners" stroke-width={dot} />
    </svg>
  );
}

function seenText(camera: SessionCamera): string {
  return camera.sees_board ? `sees the board, ${camera.corners_px.length / 2} corners` : camera.last_reason || "no picture yet";
}

// Each camera's newest picture; one of them large.
export function Views({ session }: { session: SessionState }) {
  const canvases = useRef(new Map<string, HTMLCanvasElement>());
  const [sizes, setSizes] = useState(new Map<string, [number, number]>());
  const [chosen, setChosen] = useState("");
  useTopic<ThumbnailsHead>("thumbnails", ({ head, payload }: Message<ThumbnailsHead>) => {
    for (const camera of head.cameras) {
      const canvas = canvases.current.get(camera.name);
      if (canvas) drawValues(canvas, payload.subarray(camera.offset, camera.offset + camera.width * camera.height), camera.width, camera.height, 0, 255, maps.grey);
    }
    setSizes((old) => (head.cameras.every((c) => old.get(c.name)?.[0] === c.full_width && old.get(c.name)?.[1] === c.full_height) ? old : new Map(head.cameras.map((c) => [c.name, [c.full_width, c.full_height]]))));
  });
  const sizeOf = (name: string) => sizes.get(name) ?? [659, 494];
  const large = session.cameras.find((c) => c.name === chosen);
  return (
    <Card title="What the cameras see" class="wide" aside={<span class="dim">Dots: corners found. Fields: outlined where corners are still wanted, filled where there are some.</span>}>
      <div class={large ? "seen" : ""}>
        {large && (
          <div>
            <LiveFrame camera={large.name} map="grey" stretch={false}><Corners camera={large} width={sizeOf(large.name)[0]} height={sizeOf(large.name)[1]} dot={5} /></LiveFrame>
            <p class="line"><span><strong>{large.name}</strong> {seenText(large)}</span><button type="button" onClick={() => setChosen("")}>Close</button></p>
          </div>
        )}
        <div class="thumbnails">
          {session.cameras.map((camera) => (
            <button type="button" class="thumbnail" key={camera.name} title={seenText(camera)} aria-pressed={camera.name === chosen} onClick={() => setChosen(camera.name === chosen ? "" : camera.name)}>
              <span class="overlaid">
                <canvas class="picture" role="img" aria-label={`newest frame of ${camera.name}`} ref={(element) => { if (element) canvases.current.set(camera.name, element); else canvases.current.delete(camera.name); }} />
                <Corners camera={camera} width={sizeOf(camera.name)[0]} height={sizeOf(camera.name)[1]} dot={3} />
              </span>
              <span class="line"><strong>{camera.name}</strong><span class={camera.sees_board ? "good" : "dim"}>{camera.sees_board ? "✓ board" : "○ none"}</span></span>
              <span class="line"><span>{camera.boards} boards</span><span class="dim" title="share of the nine fields that hold corners">{Math.round(100 * camera.coverage)} %</span></span>
              <span class="why dim">{camera.sees_board ? "\u00a0" : camera.last_reason}</span>
            </button>
          ))}
        </div>
      </div>
    </Card>
  );
}
