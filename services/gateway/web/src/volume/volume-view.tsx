import { useEffect, useRef, useState } from "preact/hooks";
import type { Field } from "../api";
import { type CameraPose, kFirstLook, type Look, quantised, shapeOf } from "./look";
import type { Scene } from "./scene";

// Views with one link turn together.
export class Linked {
  private scenes = new Set<Scene>();
  join(scene: Scene): () => void {
    this.scenes.add(scene);
    scene.onCamera((pose: CameraPose) => {
      for (const other of this.scenes) if (other !== scene) other.setPose(pose);
    });
    return () => this.scenes.delete(scene);
  }
}

export function VolumeView({ field, low, high, look, turning = false, linked, label, onDrawn }: {
  field: Field | null;
  low: number;
  high: number;
  look: Look;
  turning?: boolean;
  linked?: Linked;
  label: string;
  onDrawn?: (field: Field) => void;
}) {
  const box = useRef<HTMLDivElement>(null);
  const scene = useRef<Scene | null>(null);
  const drawn = useRef<{ field: Field | null; call?: (field: Field) => void }>({ field: null });
  const [state, setState] = useState<"loading" | "ready" | "none">("loading");
  const fresh = useRef(false);
  drawn.current.call = onDrawn;

  useEffect(() => {
    let leave = () => {};
    let stopped = false;
    const observer = new ResizeObserver(() => scene.current?.resize());
    if (!document.createElement("canvas").getContext("webgl2")) {
      setState("none");
      return undefined;
    }
    import("./scene").then(({ Scene }) => {
      if (stopped || !box.current) return;
      const made = new Scene(box.current, () => {
        window.dispatchEvent(new Event("flamefield:drawn"));
        if (fresh.current && drawn.current.field) drawn.current.call?.(drawn.current.field);
        fresh.current = false;
      });
      scene.current = made;
      leave = linked?.join(made) ?? leave;
      observer.observe(box.current);
      setState("ready");
    }, () => setState("none"));
    return () => {
      stopped = true;
      observer.disconnect();
      leave();
      scene.current?.dispose();
      scene.current = null;
    };
  }, []);

  useEffect(() => {
    if (state === "ready") scene.current?.setLook(look);
  }, [look, state]);
  useEffect(() => {
    if (state !== "ready" || !field) return;
    drawn.current.field = field;
    fresh.current = true;
    scene.current?.setValues(shapeOf(field), quantised(field.values, low, high));
  }, [field, low, high, state]);

  // Turns at 12 degrees a second, however many frames that is; a slow machine rests as long as it draws.
  const moving = turning && !window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  useEffect(() => {
    if (state !== "ready" || !moving) return undefined;
    let last = performance.now();
    let timer = 0;
    const turn = () => {
      const now = performance.now();
      if (!document.hidden) scene.current?.rotate(-0.012 * Math.min(now - last, 500));
      last = now;
      timer = window.setTimeout(turn, Math.max(40, 2 * (scene.current?.render_ms ?? 0)));
    };
    timer = window.setTimeout(turn, 40);
    return () => window.clearTimeout(timer);
  }, [moving, state]);

  const keys = (event: KeyboardEvent) => {
    const act: Record<string, () => void> = {
      ArrowLeft: () => scene.current?.rotate(10),
      ArrowRight: () => scene.current?.rotate(-10),
      ArrowUp: () => scene.current?.tilt(10),
      ArrowDown: () => scene.current?.tilt(-10),
      "+": () => scene.current?.zoom(1.2),
      "-": () => scene.current?.zoom(1 / 1.2),
      "0": () => scene.current?.resetCamera(),
    };
    if (!act[event.key]) return;
    event.preventDefault();
    act[event.key]();
  };
  return (
    <div class="volume-view" tabIndex={0} role="application" aria-label={`${label}. Arrow keys turn it, plus and minus zoom, zero resets.`} onKeyDown={keys}>
      <div class="volume-canvas" ref={box} />
      {state === "none" && <div class="over">This browser has no WebGL 2: the slices show the same field.</div>}
      {state === "loading" && <div class="over">Loading the 3D view …</div>}
      {state === "ready" && !field && <div class="over">No volume yet.</div>}
    </div>
  );
}

function Slider({ name, value, set, text }: { name: string; value: number; set: (value: number) => void; text: string }) {
  return (
    <label class="slider">
      <span>{name} <output>{text}</output></span>
      <input type="range" min={0} max={1} step={0.01} value={value} onInput={(e) => set(Number(e.currentTarget.value))} />
    </label>
  );
}

export function LookControls({ look, set, high, turning, setTurning }: {
  look: Look;
  set: (look: Look) => void;
  high: number;
  turning?: boolean;
  setTurning?: (on: boolean) => void;
}) {
  const change = (part: Partial<Look>) => set({ ...look, ...part });
  const value = (share: number) => (share * high).toPrecision(2);
  return (
    <div class="look">
      <label>Show
        <select value={look.mode} onChange={(e) => change({ mode: e.currentTarget.value as Look["mode"] })}>
          <option value="glow">glowing volume</option>
          <option value="brightest">brightest along the ray</option>
          <option value="surface">iso-surface</option>
          <option value="both">volume and surface</option>
        </select>
      </label>
      {look.mode !== "surface" && <Slider name="Clear below" value={look.threshold} set={(threshold) => change({ threshold })} text={value(look.threshold)} />}
      {look.mode !== "surface" && look.mode !== "brightest" && <Slider name="Opacity" value={look.opacity} set={(opacity) => change({ opacity })} text={`${Math.round(100 * look.opacity)} %`} />}
      {(look.mode === "surface" || look.mode === "both") && <Slider name="Surface at" value={look.iso} set={(iso) => change({ iso })} text={value(look.iso)} />}
      <label>Clip
        <select value={look.clip} onChange={(e) => change({ clip: e.currentTarget.value as Look["clip"] })}>
          <option value="none">nothing</option>
          <option value="x">x</option>
          <option value="y">y (height)</option>
          <option value="z">z</option>
        </select>
      </label>
      {look.clip !== "none" && <Slider name="Clip at" value={look.clipAt} set={(clipAt) => change({ clipAt })} text={`${Math.round(100 * look.clipAt)} %`} />}
      {setTurning && <label class="check"><input type="checkbox" checked={turning} onChange={(e) => setTurning(e.currentTarget.checked)} /> Turn</label>}
      <button type="button" class="quiet" onClick={() => set({ ...kFirstLook, map: look.map })}>Reset</button>
    </div>
  );
}
