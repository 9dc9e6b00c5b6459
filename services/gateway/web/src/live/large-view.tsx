import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import type { FrameHead, Message } from "../api";
import { maps, type MapName } from "../colour";
import { useTopic } from "../hooks";
import { shown } from "../live-connection";
import { drawValues } from "./pixels";

type Levels = { head: FrameHead; values: Uint8Array | Uint16Array };

export function levelsOf(message: Message<FrameHead>): Levels {
  const { head, payload } = message;
  const wide = head.camera.bits > 8;
  return { head, values: wide ? new Uint16Array(payload.buffer, payload.byteOffset, payload.byteLength / 2) : payload };
}

// One frame with every pixel, a cross that mouse and arrow keys move, and the grey level under it. What is drawn over it
// may be given as children.
export function FrameView({ levels, map, stretch, children }: { levels: Levels | null; map: MapName; stretch: boolean; children?: ComponentChildren }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [cross, setCross] = useState<{ x: number; y: number } | null>(null);
  useEffect(() => {
    if (!levels || !canvas.current) return;
    const { camera } = levels.head;
    const full = (1 << camera.bits) - 1;
    drawValues(canvas.current, levels.values, camera.full_width, camera.full_height, 0, stretch ? Math.max(camera.max, 1) : full, maps[map], full);
  }, [levels, map, stretch]);
  const camera = levels?.head.camera;
  const place = (event: MouseEvent) => {
    if (!camera || !canvas.current) return;
    const box = canvas.current.getBoundingClientRect();
    const x = Math.floor(((event.clientX - box.left) / box.width) * camera.full_width);
    const y = Math.floor(((event.clientY - box.top) / box.height) * camera.full_height);
    if (x >= 0 && y >= 0 && x < camera.full_width && y < camera.full_height) setCross({ x, y });
  };
  const move = (event: KeyboardEvent) => {
    const steps: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const step = steps[event.key];
    if (!step || !camera) return;
    event.preventDefault();
    const far = event.shiftKey ? 10 : 1;
    const from = cross ?? { x: camera.full_width >> 1, y: camera.full_height >> 1 };
    setCross({
      x: Math.min(Math.max(from.x + far * step[0], 0), camera.full_width - 1),
      y: Math.min(Math.max(from.y + far * step[1], 0), camera.full_height - 1),
    });
  };
  const at = cross && levels && camera && cross.x < camera.full_width && cross.y < camera.full_height ? levels.values[cross.y * camera.full_width + cross.x] : null;
  return (
    <div class="frame-view">
      <div class="frame" tabIndex={0} role="application" aria-label={camera ? `Frame of ${camera.name}. Arrow keys move the cross, with shift by ten pixels.` : "No frame yet"} onMouseMove={place} onKeyDown={move}>
        <canvas ref={canvas} style={{ aspectRatio: camera ? `${camera.full_width} / ${camera.full_height}` : "4 / 3" }} />
        {levels && children}
        {cross && camera && (
          <svg viewBox={`0 0 ${camera.full_width} ${camera.full_height}`} preserveAspectRatio="none" aria-hidden="true">
            <path d={`M0 ${cross.y + 0.5}H${camera.full_width}M${cross.x + 0.5} 0V${camera.full_height}`} class="cross" vector-effect="non-scaling-stroke" />
          </svg>
        )}
        {!levels && <div class="over">No frame of this camera yet.</div>}
      </div>
      <p class="readout" aria-live="off">
        {camera && <>
          <span>{cross ? `x ${cross.x} px, y ${cross.y} px: ` : "Point at a pixel. "}{at !== null && <b>{at} of {(1 << camera.bits) - 1}</b>}</span>
          <span class="dim">mean {camera.mean.toFixed(1)} · max {camera.max} · {camera.saturated} px at full scale{camera.exposure_us ? ` · ${camera.exposure_us} µs` : ""} · pulse {camera.pulse}</span>
        </>}
      </p>
    </div>
  );
}

export function LiveFrame({ camera, map, stretch, children }: { camera: string; map: MapName; stretch: boolean; children?: ComponentChildren }) {
  const [levels, setLevels] = useState<Levels | null>(null);
  useEffect(() => setLevels(null), [camera]);
  useTopic<FrameHead>(camera ? `frame:${camera}` : null, (message) => {
    setLevels(levelsOf(message));
    shown("frame", message.head.pulse_time_ns, message.head.complete_time_ns);
  });
  return <FrameView levels={levels} map={map} stretch={stretch}>{children}</FrameView>;
}
