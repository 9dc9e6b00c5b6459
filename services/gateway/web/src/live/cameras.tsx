import { useEffect, useRef, useState } from "preact/hooks";
import type { CameraState, Message, ThumbnailInfo, ThumbnailsHead } from "../api";
import { maps, type MapName } from "../colour";
import { count } from "../format";
import { useTopic } from "../hooks";
import { live, shown } from "../live-connection";
import { drawValues } from "./pixels";

// Of 64 bins, logarithmic; the last one, full scale, stands out by its own colour and its place.
function Histogram({ bins }: { bins: number[] }) {
  const ref = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const canvas = ref.current;
    const context = canvas?.getContext("2d");
    if (!canvas || !context) return;
    context.clearRect(0, 0, 64, 20);
    const css = getComputedStyle(canvas);
    const top = Math.log1p(Math.max(...bins));
    bins.forEach((bin, i) => {
      if (!bin) return;
      const height = Math.max(1, (20 * Math.log1p(bin)) / top);
      context.fillStyle = css.getPropertyValue(i === 63 ? "--poor" : "--dim");
      context.fillRect(i, 20 - height, 1, height);
    });
  }, [bins]);
  return <canvas class="histogram" width={64} height={20} ref={ref} aria-hidden="true" />;
}

function lossText(camera: CameraState): string {
  const causes = Object.entries(camera.losses).filter(([, n]) => n > 0);
  return causes.map(([cause, n]) => `${n} ${cause}`).join(", ");
}

function Thumbnail({ camera, info, chosen, choose, canvas }: {
  camera: CameraState;
  info: ThumbnailInfo | undefined;
  chosen: boolean;
  choose: () => void;
  canvas: (element: HTMLCanvasElement | null) => void;
}) {
  const lost = Object.values(camera.losses).reduce((a, b) => a + b, 0);
  const age = camera.newest_age_s;
  const saturated = info ? (100 * info.saturated) / (info.full_width * info.full_height) : 0;
  const note = !camera.connected ? "✗ gone" : lost ? `✗ ${count(lost)} lost` : age === null ? "no frame yet" : age > 10 ? `${age > 999 ? "old" : `${age.toFixed(0)} s old`}` : `${age.toFixed(1)} s`;
  return (
    <button type="button" class={`thumbnail ${camera.connected ? "" : "gone"}`} aria-pressed={chosen} onClick={choose} title={`${camera.name} at ${camera.address}${camera.connected ? "" : ": no connection"}${lost ? `; lost: ${lossText(camera)}` : ""}${saturated > 0 ? `; ${info?.saturated} px at full scale` : ""}`}>
      <canvas class="picture" ref={canvas} role="img" aria-label={`newest frame of ${camera.name}`} />
      <span class="line"><strong>{camera.name}</strong><span class={!camera.connected || lost ? "poor" : "dim"}>{note}</span></span>
      <span class="line">
        {info ? <Histogram bins={info.histogram} /> : <span class="histogram" />}
        <span class={saturated > 0 ? "fair" : "dim"}>{info ? (saturated > 0 ? `▲ ${saturated < 0.1 ? "<0.1" : saturated.toFixed(1)} %` : `max ${info.max}`) : ""}</span>
      </span>
    </button>
  );
}

export function Cameras({ cameras, chosen, choose, map, onSet }: {
  cameras: CameraState[];
  chosen: string;
  choose: (name: string) => void;
  map: MapName;
  onSet: (head: ThumbnailsHead) => void;
}) {
  const canvases = useRef(new Map<string, HTMLCanvasElement>());
  const newest = useRef<Message<ThumbnailsHead> | null>(null);
  const [infos, setInfos] = useState(new Map<string, ThumbnailInfo>());
  const draw = () => {
    if (!newest.current) return;
    const { head, payload } = newest.current;
    for (const camera of head.cameras) {
      const canvas = canvases.current.get(camera.name);
      if (!canvas) continue;
      const pixels = payload.subarray(camera.offset, camera.offset + camera.width * camera.height);
      drawValues(canvas, pixels, camera.width, camera.height, 0, 255, maps[map], 255);
    }
  };
  useTopic<ThumbnailsHead>("thumbnails", (message) => {
    newest.current = message;
    draw();
    setInfos(new Map(message.head.cameras.map((camera) => [camera.name, camera])));
    onSet(message.head);
    shown("thumbnails", message.head.pulse_time_ns, message.head.complete_time_ns);
  });
  useEffect(draw, [map, cameras.length]);
  return (
    <div class="thumbnails" role="group" aria-label="Cameras">
      {cameras.map((camera) => (
        <Thumbnail key={camera.name} camera={camera} info={infos.get(camera.name)} chosen={camera.name === chosen} choose={() => choose(camera.name)}
          canvas={(element) => { if (element) canvases.current.set(camera.name, element); else canvases.current.delete(camera.name); }} />
      ))}
    </div>
  );
}

export const setAge_s = (head: ThumbnailsHead): number => (live.serverNow_ms() - head.pulse_time_ns / 1e6) / 1000;
