import { useState } from "preact/hooks";
import { ApiError, type ArrayState, send } from "../api";
import { Confirm, Problem } from "../parts/basics";

type Kind = "live" | "burst" | "dark" | "background" | "flat";
const kAdvice: Record<Exclude<Kind, "burst">, string> = {
  dark: "Put the caps on all lenses first. The dark level of every later volume comes from the newest dark capture.",
  background: "Put the flame out first. Stray light and reflections of every later volume are taken off by the newest background.",
  flat: "Light the ring evenly first.",
  live: "Every pulse is recorded until you stop. This fills the disk.",
};

// What someone at the burner does. Whatever costs data, now or later, is asked twice.
export function Controls({ array, canSteer }: { array: ArrayState | null; canSteer: boolean }) {
  const [pulses, setPulses] = useState(30);
  const [asking, setAsking] = useState<Kind | "stop" | null>(null);
  const [busy, setBusy] = useState("");
  const [problem, setProblem] = useState("");
  const act = async (what: string, path: string, body: object) => {
    setBusy(what);
    setProblem("");
    try {
      await send("POST", path, body);
    } catch (error) {
      setProblem(error instanceof ApiError || error instanceof Error ? error.message : String(error));
    } finally {
      setBusy("");
    }
  };
  const capture = (kind: Kind) => act(`arming for ${kind}`, "capture", { kind, pulses: kind === "live" ? 0 : pulses });
  const running = array !== null && array.phase !== "idle";
  const off = !array || !canSteer || busy !== "" || running;
  const valid = Number.isInteger(pulses) && pulses >= 1 && pulses <= 1_000_000;
  const left = array && running && array.pulses_wanted > 0 ? array.pulses_wanted - array.sets : 0;
  return (
    <div class="controls">
      <div class="buttons">
        <button type="button" class="primary" disabled={off || !valid} onClick={() => capture("burst")}>● Burst</button>
        <label class="pulses">of <input type="number" min={1} max={1000000} step={1} value={pulses} aria-invalid={!valid} onInput={(e) => setPulses(Number(e.currentTarget.value))} /> pulses</label>
        <span class="gap" />
        <button type="button" disabled={off} onClick={() => setAsking("live")} title="Record every pulse until stopped">Arm until stopped</button>
        <button type="button" disabled={off || !valid} onClick={() => setAsking("dark")}>Dark</button>
        <button type="button" disabled={off || !valid} onClick={() => setAsking("background")}>Background</button>
        <button type="button" disabled={off || !valid} onClick={() => setAsking("flat")}>Flat</button>
        <span class="gap" />
        <button type="button" class="danger" disabled={!running || !canSteer || busy === "stopping"} onClick={() => (left > 0 ? setAsking("stop") : act("stopping", "capture/stop", {}))}>■ Stop</button>
      </div>
      <p class="note" role="status">
        {busy ? `${busy} …` : running && array ? `${array.capture}: ${array.sets}${array.pulses_wanted ? ` of ${array.pulses_wanted}` : ""} pulses` : array?.capture ? `Last: ${array.capture}` : "Nothing captured yet."}
      </p>
      {problem && <Problem text={problem} />}
      {asking === "stop" && array && (
        <Confirm title="Stop this burst?" act="Stop" onAct={() => act("stopping", "capture/stop", {})} onClose={() => setAsking(null)}>
          {left} of {array.pulses_wanted} pulses have not been recorded and will not be. What was triggered is stored first.
        </Confirm>
      )}
      {asking && asking !== "stop" && asking !== "burst" && (
        <Confirm title={asking === "live" ? "Arm until stopped?" : `Capture ${pulses} ${asking} frame sets?`} act={asking === "live" ? "Arm" : "Capture"} onAct={() => capture(asking)} onClose={() => setAsking(null)}>
          {kAdvice[asking]}
        </Confirm>
      )}
    </div>
  );
}
