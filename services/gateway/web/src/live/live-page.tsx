import { useCallback, useRef, useState } from "preact/hooks";
import { fieldOf, type Field, type Status, type ThumbnailsHead, type VolumeHead } from "../api";
import type { MapName } from "../colour";
import { bytes, count, duration } from "../format";
import { useInterval, useLink, useStatus, useTopic } from "../hooks";
import { live, shown } from "../live-connection";
import { Card, Empty, Tile } from "../parts/basics";
import { ColourBar, Slices } from "../volume/slices";
import { kFirstLook, type Look } from "../volume/look";
import { LookControls, VolumeView } from "../volume/volume-view";
import { Cameras, setAge_s } from "./cameras";
import { Controls } from "./controls";
import { LiveFrame } from "./large-view";

function Counters({ status, age_s }: { status: Status; age_s: number | null }) {
  const { counters: c, disk, dispatcher } = status;
  const idle = !status.array || status.array.phase === "idle";
  const stored = c.sets === c.pulses;
  const complete = stored && c.volumes === c.sets && c.sets > 0;
  const left = disk.seconds_to_full;
  return (
    <div class="tiles" role="group" aria-label="Counters">
      <Tile value={count(c.pulses)} name="pulses" mark={complete ? "good" : ""} title="of the newest capture" />
      <Tile value={count(c.sets)} name={stored ? "frame sets stored = pulses" : `frame sets, ${c.pulses - c.sets} to come`} mark={stored && c.sets > 0 ? "good" : c.pulses > 0 ? "fair" : ""} />
      <Tile value={count(c.volumes)} name={c.volumes === c.sets ? "volumes = frame sets" : `volumes, ${count(Math.max(c.sets - c.volumes, 0))} to come`} mark={complete ? "good" : c.volumes < c.sets && c.queued > 0 ? "fair" : ""} />
      <Tile value={count(c.queued)} name="reconstructions waiting" />
      <Tile value={age_s === null ? "–" : duration(Math.max(age_s, 0))} name="age of the shown set" mark={!idle && age_s !== null && age_s > 5 ? "poor" : ""} title="since its trigger pulse" />
      <Tile value={count(c.lost_frames)} name="frames lost" mark={c.lost_frames > 0 ? "poor" : c.pulses > 0 ? "good" : ""} />
      <Tile value={count(c.failed)} name="reconstructions failed" mark={c.failed > 0 ? "poor" : ""} />
      <Tile value={left === null ? bytes(disk.free_bytes) : duration(left)} name={left === null ? "free on the disk" : `until the disk is full (${bytes(disk.free_bytes)})`} mark={left !== null && left < 600 ? "poor" : ""} />
      <Tile value={status.sets_per_s > 0 ? `${status.sets_per_s.toFixed(1)} Hz` : "–"} name={`frame sets a second, ${dispatcher?.workers.length ?? 0} workers`} />
    </div>
  );
}

function Alarms({ status }: { status: Status }) {
  if (status.alarms.length === 0) return null;
  return (
    <ul class="alarms" aria-label="Alarms" aria-live="polite">
      {status.alarms.map((alarm) => <li key={alarm.what} class={alarm.severe ? "poor" : "fair"}><span aria-hidden="true">{alarm.severe ? "✗ " : "▲ "}</span>{alarm.text}</li>)}
    </ul>
  );
}

function Flame() {
  const [field, setField] = useState<Field | null>(null);
  const [look, setLook] = useState<Look>(kFirstLook);
  const [turning, setTurning] = useState(true);
  const [held, setHeld] = useState<number | null>(null);
  useTopic<VolumeHead>("volume", (message) => setField(fieldOf(message)));
  const high = held ?? field?.head.high ?? 1;
  const told = useRef({ slices: "", view: "" });
  // A new look draws the same field again; only its first drawing tells how far behind we are.
  const tell = useCallback((what: "slices" | "view") => (drawn: Field) => {
    const { run, pulse_time_ns, committed_time_ns } = drawn.head;
    if (told.current[what] === run) return;
    told.current[what] = run;
    shown(what, pulse_time_ns, committed_time_ns);
  }, []);
  const grid = field?.head;
  return (
    <Card title={field?.head.is_unfinished ? "Best so far" : "Newest volume"} class="flame" aside={field && (field.head.is_unfinished ? <span class="dim">{field.head.run}, still evolving</span> : <a class="long" href={`#/runs/${encodeURIComponent(field.head.run)}`}>{field.head.run}</a>)}>
      <div class="flame-body">
        <div>
          <VolumeView field={field} low={0} high={high} look={look} turning={turning} label="Newest volume in 3D" onDrawn={tell("view")} />
          <div class="line wrap">
            <ColourBar low={0} high={high} />
            <label class="check"><input type="checkbox" checked={held !== null} onChange={(e) => setHeld(e.currentTarget.checked ? high : null)} /> Keep this scale</label>
          </div>
        </div>
        <div class="flame-side">
          <Slices field={field} low={0} high={high} onDrawn={tell("slices")} />
        </div>
      </div>
      <LookControls look={look} set={setLook} high={high} turning={turning} setTurning={setTurning} />
      {grid && <p class="note">{grid.full_size.join(" × ")} voxels{grid.full_size[0] !== grid.size[0] ? `, shown as ${grid.size.join(" × ")}` : ""} of {grid.spacing_mm[0].toPrecision(3)} mm · {grid.solver} · y is the height above the burner (HAB)</p>}
    </Card>
  );
}

export function LivePage() {
  const status = useStatus();
  const link = useLink();
  const [chosen, choose] = useState("");
  const [map, setMap] = useState<MapName>("inferno");
  const [stretch, setStretch] = useState(false);
  const set = useRef<ThumbnailsHead | null>(null);
  const [age_s, setAge] = useState<number | null>(null);
  const showAge = () => setAge(set.current ? setAge_s(set.current) : null);
  useInterval(200, showAge);
  const seen = useRef("");
  if (!status) return <Empty title={link.state === "lost" ? "No connection" : "Connecting …"}>The page fills as soon as flamefield answers.</Empty>;
  if (seen.current !== `${status.counters.sets}`) {
    seen.current = `${status.counters.sets}`;
    if (status.array) requestAnimationFrame(() => set.current && shown("counters", set.current.pulse_time_ns, set.current.complete_time_ns));
  }
  const cameras = status.array?.cameras ?? [];
  const camera = cameras.some((c) => c.name === chosen) ? chosen : (cameras[0]?.name ?? "");
  return (
    <div class="live">
      <Counters status={status} age_s={age_s} />
      <Alarms status={status} />
      <Flame />
      <div class="stack">
      <Card title="Capture"><Controls array={status.array} canSteer={link.state === "open"} /></Card>
      <Card title={`Camera ${camera}`} class="large" aside={
        <span class="line">
          <label>Colours <select value={map} onChange={(e) => setMap(e.currentTarget.value as MapName)}><option value="inferno">inferno</option><option value="grey">grey</option></select></label>
          <label class="check"><input type="checkbox" checked={stretch} onChange={(e) => setStretch(e.currentTarget.checked)} /> Stretch</label>
        </span>
      }>
        {camera ? <LiveFrame camera={camera} map={map} stretch={stretch} /> : <Empty title="No cameras">Name them in lab.toml, or run without a configuration for a simulated ring.</Empty>}
      </Card>
      </div>
      <Card title="Cameras, newest frames" class="cameras" aside={<span class="dim">{live.status?.array?.capture}</span>}>
        {cameras.length ? <Cameras cameras={cameras} chosen={camera} choose={choose} map={map} onSet={(head) => { set.current = head; showAge(); }} />
          : <Empty title="No camera array">The acquisition service does not answer.</Empty>}
      </Card>
    </div>
  );
}
