import { useRef, useState } from "preact/hooks";
import { get, send } from "../api";
import { significant } from "../format";
import { useInterval } from "../hooks";
import { Card, Confirm, Dialog, Problem, Tile } from "../parts/basics";
import { kVerdicts, type SessionState, type Unavailable } from "./session-state";
import { Solution } from "./solution";
import { Views } from "./views";

type Act = (what: string, body?: object) => Promise<void>;
const kWantedVolume = 0.6; // share of the measuring volume, as the session wants it

function Start({ session, act }: { session: SessionState; act: Act }) {
  const [poses, setPoses] = useState(20);
  const [automatic, setAutomatic] = useState(true);
  return (
    <>
      <p>Put the board into its holder on the burner: that pose fixes the world frame. Then show it to the cameras, tilted every way and through the whole measuring volume. The array shows pictures and stores only the poses that are taken.</p>
      <div class="buttons">
        <label>Poses wanted <input type="number" min={2} max={1000} value={poses} onInput={(e) => setPoses(Number(e.currentTarget.value))} /></label>
        <label class="check"><input type="checkbox" checked={automatic} onChange={(e) => setAutomatic(e.currentTarget.checked)} /> take a pose as soon as the board is still</label>
        <button type="button" class="primary" disabled={!(poses >= 2 && poses <= 1000)} onClick={() => act("start", { wanted_poses: Math.round(poses), automatic })}>Start a session</button>
        {session.accepted_version > 0 && <span class="good" role="status">✓ Calibration {session.accepted_version} accepted</span>}
      </div>
    </>
  );
}

function Guide({ session, act, ask }: { session: SessionState; act: Act; ask: (what: "accept" | "discard") => void }) {
  const seeing = session.cameras.filter((c) => c.sees_board).length;
  const next = session.state === "detecting" ? session.needed[0] ?? "Nothing is missing: solve." : session.message;
  return (
    <>
      {/* first, so that they stay in their place while the rest grows and shrinks */}
      <div class="buttons">
        <button type="button" disabled={session.state === "solving"} onClick={() => act("take")}>Take this pose</button>
        <button type="button" class={session.state === "detecting" ? "primary" : ""} disabled={session.state === "solving" || session.poses === 0} onClick={() => act("solve")}>{session.state === "solving" ? "Solving …" : "Solve"}</button>
        <button type="button" class={session.state === "solved" ? "primary" : ""} disabled={session.state !== "solved"} onClick={() => ask("accept")}>Accept …</button>
        {session.report && <a href={`/${session.report}`} target="_blank" rel="noreferrer">Report</a>}
        <span class="grow" />
        <button type="button" class="danger" onClick={() => ask("discard")}>Discard …</button>
      </div>
      <div class="tiles">
        <Tile value={`${session.poses} of ${session.wanted_poses}`} name="poses taken" mark={session.poses >= session.wanted_poses ? "good" : "fair"} />
        <Tile value={`${Math.round(100 * session.volume_coverage)} %`} name={`of the measuring volume covered, ${100 * kWantedVolume} % wanted`} mark={session.volume_coverage >= kWantedVolume ? "good" : "fair"} />
        <Tile value={`${seeing} of ${session.cameras.length}`} name="cameras see the board" />
        <Tile value={seeing === 0 ? "not seen" : session.still ? "still" : "moving"} name={session.new ? "board, in a new place" : "board"} mark={session.still && session.new ? "good" : ""} />
      </div>
      <p role="status" class="next"><strong>{next}</strong>{session.state === "detecting" && session.message && <span class="dim"> {session.message}</span>}</p>
      {session.state === "detecting" && session.needed.length > 1 && <ul class="needed">{session.needed.slice(1, 6).map((line) => <li key={line}>{line}</li>)}{session.needed.length > 6 && <li class="dim">and {session.needed.length - 6} more</li>}</ul>}
      {session.links_missing.length > 0 && <p class="note">Not yet seen together: {session.links_missing.slice(0, 8).map((l) => `${l.a} and ${l.b}`).join(", ")}</p>}
    </>
  );
}

function Accept({ session, act, close }: { session: SessionState; act: Act; close: () => void }) {
  const [name, setName] = useState("");
  const [note, setNote] = useState("");
  const verdict = kVerdicts[session.verdict];
  return (
    <Dialog title="Accept this calibration?" onClose={close}>
      <p class={verdict?.class}>{verdict?.mark} {verdict?.text}: {significant(session.volume_error_px.worst)} px expected at worst in the volume. Bursts from now on are reconstructed with it.</p>
      <p><label>Your name <input value={name} maxLength={200} onInput={(e) => setName(e.currentTarget.value)} /></label></p>
      <p><label>Note <input value={note} maxLength={2000} onInput={(e) => setNote(e.currentTarget.value)} /></label></p>
      <div class="buttons">
        <button type="button" class="primary" disabled={name.trim() === ""} onClick={() => { void act("accept", { accepted_by: name.trim(), note: note.trim() }); close(); }}>Accept</button>
        <button type="button" onClick={close}>Cancel</button>
      </div>
    </Dialog>
  );
}

// The guided session: show the board, see what is missing, solve, accept.
export function Session({ onAccepted }: { onAccepted: () => void }) {
  const [session, setSession] = useState<SessionState | Unavailable | null>(null);
  const [problem, setProblem] = useState("");
  const [asking, setAsking] = useState<"accept" | "discard" | null>(null);
  const waiting = useRef(false);
  const held = session && session.state !== "unavailable" ? session : null;
  const running = held && held.state !== "idle" ? held : null;
  const refresh = async () => {
    if (waiting.current || document.hidden) return;
    waiting.current = true;
    await get<SessionState | Unavailable>("calibration").then(setSession, () => {}); // a lost connection is told at the top of the page
    waiting.current = false;
  };
  useInterval(running ? 300 : session ? 2000 : 200, () => void refresh());
  const act: Act = async (what, body = {}) => {
    setProblem("");
    try {
      await send("POST", `calibration/${what}`, body);
      if (what === "accept") onAccepted();
    } catch (error) {
      setProblem((error as Error).message);
    }
    await refresh();
  };
  return (
    <>
      <Card title="Session" class="wide" aside={running ? <span class="dim">{running.board} · {running.session} · {running.state}</span> : undefined}>
        {!session && <p class="note" role="status">Asking for the session …</p>}
        {session?.state === "unavailable" && <p class="note">No guided session can be held here: {session.why}</p>}
        {held && !running && <Start session={held} act={act} />}
        {running && <Guide session={running} act={act} ask={setAsking} />}
        {held?.error && <Problem text={held.error} />}
        {problem && <Problem text={problem} />}
      </Card>
      {running && <Solution session={running} />}
      {running && <Views session={running} />}
      {asking === "discard" && <Confirm title="Discard this session?" act="Discard" onAct={() => act("discard")} onClose={() => setAsking(null)}>Its pictures stay in the ledger; its solution is lost.</Confirm>}
      {asking === "accept" && running && <Accept session={running} act={act} close={() => setAsking(null)} />}
    </>
  );
}
