import { useRef, useState } from "preact/hooks";
import { ApiError, get, type Message, send, type ThumbnailsHead } from "../api";
import { maps } from "../colour";
import { significant } from "../format";
import { useInterval, useTopic } from "../hooks";
import { drawValues } from "../live/pixels";
import { Card, Confirm, Dialog, Problem, Tile } from "../parts/basics";
import { kVerdicts, type SessionCamera, type SessionState } from "./session-state";

function Corners({ camera, width, height }: { camera: SessionCamera; width: number; height: number }) {
  const dots = [];
  for (let i = 0; i + 1 < camera.corners_px.length; i += 2) dots.push(<circle key={i} cx={camera.corners_px[i]} cy={camera.corners_px[i + 1]} r={width / 90} />);
  const [left = 0, top = 0, wide = 0, high = 0] = camera.region_px;
  return (
    <svg viewBox={`0 0 ${width} ${height}`} preserveAspectRatio="none" aria-hidden="true">
      {wide > 0 && camera.covered.map((covered, i) => (
        <rect key={i} x={left + ((i % 3) * wide) / 3} y={top + (Math.floor(i / 3) * high) / 3} width={wide / 3} height={high / 3} class={covered ? "covered" : "open"} />
      ))}
      {dots}
    </svg>
  );
}

// Each camera's newest picture with the corners found in it, and the nine fields that corners should reach.
function Views({ session }: { session: SessionState }) {
  const canvases = useRef(new Map<string, HTMLCanvasElement>());
  const [sizes, setSizes] = useState(new Map<string, [number, number]>());
  useTopic<ThumbnailsHead>("thumbnails", ({ head, payload }: Message<ThumbnailsHead>) => {
    for (const camera of head.cameras) {
      const canvas = canvases.current.get(camera.name);
      if (canvas) drawValues(canvas, payload.subarray(camera.offset, camera.offset + camera.width * camera.height), camera.width, camera.height, 0, 255, maps.grey);
    }
    setSizes(new Map(head.cameras.map((camera) => [camera.name, [camera.full_width, camera.full_height]])));
  });
  return (
    <div class="thumbnails">
      {session.cameras.map((camera) => {
        const [width, height] = sizes.get(camera.name) ?? [659, 494];
        return (
          <figure class="thumbnail" key={camera.name} title={camera.sees_board ? "sees the board" : camera.last_reason}>
            <div class="overlaid">
              <canvas class="picture" role="img" aria-label={`newest frame of ${camera.name}`} ref={(element) => { if (element) canvases.current.set(camera.name, element); else canvases.current.delete(camera.name); }} />
              <Corners camera={camera} width={width} height={height} />
            </div>
            <figcaption>
              <span class="line"><strong>{camera.name}</strong><span class={camera.sees_board ? "good" : "dim"}>{camera.sees_board ? "✓ board" : "○ none"}</span></span>
              <span class="line"><span>{camera.boards} boards</span><span class="dim">{Math.round(100 * camera.coverage)} % covered</span></span>
            </figcaption>
          </figure>
        );
      })}
    </div>
  );
}

function Solution({ session }: { session: SessionState }) {
  const verdict = kVerdicts[session.verdict];
  if (!verdict) return null;
  return (
    <Card title="Solution" class="wide" aside={<strong class={verdict.class}>{verdict.mark} {verdict.text}</strong>}>
      <div class="tiles">
        <Tile value={`${significant(session.rms_px)} px`} name="RMS over all corners" />
        <Tile value={`${significant(session.volume_error_px.mean)} px`} name="expected error in the volume, mean" />
        <Tile value={`${significant(session.volume_error_px.worst)} px`} name={`worst (${session.volume_error_px.camera})`} />
      </div>
      {session.moved_cameras.length > 0 && <p class="fair">▲ Moved since calibration {session.previous_version}: {session.moved_cameras.join(", ")}</p>}
      <div class="scroll" tabIndex={0} role="region" aria-label="Solution by camera">
        <table>
          <thead><tr><th scope="col">Camera</th><th scope="col" class="n">Boards</th><th scope="col" class="n">Expected error (px)</th><th scope="col" class="n">Shift since the last one (px)</th></tr></thead>
          <tbody>{session.cameras.map((c) => <tr key={c.name}><th scope="row">{c.name}</th><td class="n">{c.boards}</td><td class="n">{significant(c.expected_px)}</td><td class={`n ${c.moved ? "fair" : ""}`}>{c.moved ? "▲ " : ""}{significant(c.shift_px)}</td></tr>)}</tbody>
        </table>
      </div>
    </Card>
  );
}

// The guided session: show the board, see what is missing, solve, accept.
export function Session({ onAccepted }: { onAccepted: () => void }) {
  const [session, setSession] = useState<SessionState | null>(null);
  const [missing, setMissing] = useState("");
  const [problem, setProblem] = useState("");
  const [asking, setAsking] = useState<"accept" | "discard" | null>(null);
  const [poses, setPoses] = useState(20);
  const [automatic, setAutomatic] = useState(true);
  const [name, setName] = useState("");
  const [note, setNote] = useState("");
  const waiting = useRef(false);
  useInterval(session && session.state !== "idle" ? 300 : 2000, () => {
    if (waiting.current || document.hidden) return;
    waiting.current = true;
    get<SessionState>("calibration").then((state) => { setMissing(""); setSession(state); }, (error: ApiError) => setMissing(error.message)).finally(() => { waiting.current = false; });
  });
  const act = async (what: string, body: object = {}) => {
    setProblem("");
    try {
      const answer = await send<SessionState>("POST", `calibration/${what}`, body);
      if (answer.cameras) setSession(answer);
      if (what === "accept") onAccepted();
    } catch (error) {
      setProblem((error as Error).message);
    }
  };
  const running = session && session.state !== "idle";
  return (
    <>
      <Card title="Session" class="wide" aside={running ? <span class="dim">{session.session} · {session.state}</span> : undefined}>
        {missing && !session && <p class="note">No guided session can be held here ({missing}).</p>}
        {session && !running && (
          <div class="buttons">
            <label>Poses wanted <input type="number" min={5} max={200} value={poses} onInput={(e) => setPoses(Number(e.currentTarget.value))} /></label>
            <label class="check"><input type="checkbox" checked={automatic} onChange={(e) => setAutomatic(e.currentTarget.checked)} /> take a pose as soon as the board is still</label>
            <button type="button" class="primary" onClick={() => act("start", { wanted_poses: poses, automatic })}>Start a session</button>
            {session.accepted_version > 0 && <span class="good" role="status">✓ Calibration {session.accepted_version} accepted</span>}
          </div>
        )}
        {running && (
          <>
            <div class="tiles">
              <Tile value={`${session.poses} of ${session.wanted_poses}`} name="poses taken" mark={session.poses >= session.wanted_poses ? "good" : "fair"} />
              <Tile value={`${Math.round(100 * session.volume_coverage)} %`} name="of the measuring volume covered" mark={session.volume_coverage > 0.8 ? "good" : "fair"} />
              <Tile value={`${session.cameras.filter((c) => c.sees_board).length} of ${session.cameras.length}`} name="cameras see the board" />
              <Tile value={session.still ? "still" : "moving"} name={session.new ? "board, at a new place" : "board"} mark={session.still && session.new ? "good" : ""} />
            </div>
            <p role="status"><strong>{session.needed[0] ?? (session.state === "detecting" ? "Nothing is missing: solve." : session.message)}</strong></p>
            {session.needed.length > 1 && <ul>{session.needed.slice(1, 6).map((line) => <li key={line}>{line}</li>)}</ul>}
            {session.links_missing.length > 0 && <p class="note">Not yet seen together: {session.links_missing.slice(0, 8).map((l) => `${l.a} and ${l.b}`).join(", ")}</p>}
            <div class="buttons">
              <button type="button" disabled={session.state !== "detecting" || session.automatic} onClick={() => act("take")}>Take this pose</button>
              <button type="button" class="primary" disabled={session.state === "solving" || session.poses === 0} onClick={() => act("solve")}>{session.state === "solving" ? "Solving …" : "Solve"}</button>
              <button type="button" disabled={session.state !== "solved"} onClick={() => setAsking("accept")}>Accept …</button>
              {session.report && <a href={`/${session.report}`} target="_blank" rel="noreferrer">report</a>}
              <span class="grow" />
              <button type="button" class="danger" onClick={() => setAsking("discard")}>Discard …</button>
            </div>
          </>
        )}
        {session?.error && <Problem text={session.error} />}
        {problem && <Problem text={problem} />}
      </Card>
      {running && <Card title="What the cameras see" class="wide"><Views session={session} /></Card>}
      {session && session.verdict && session.state !== "idle" && <Solution session={session} />}
      {asking === "discard" && <Confirm title="Discard this session?" act="Discard" onAct={() => act("discard")} onClose={() => setAsking(null)}>Its pictures stay in the ledger; its solution is lost.</Confirm>}
      {asking === "accept" && session && (
        <Dialog title="Accept this calibration?" onClose={() => setAsking(null)}>
          <p class={kVerdicts[session.verdict]?.class}>{kVerdicts[session.verdict]?.mark} {kVerdicts[session.verdict]?.text}: {significant(session.volume_error_px.worst)} px at worst in the volume. Bursts from now on are reconstructed with it.</p>
          <p><label>Your name <input value={name} onInput={(e) => setName(e.currentTarget.value)} /></label></p>
          <p><label>Note <input value={note} onInput={(e) => setNote(e.currentTarget.value)} /></label></p>
          <div class="buttons">
            <button type="button" class="primary" disabled={name.trim() === ""} onClick={() => { void act("accept", { accepted_by: name.trim(), note }); setAsking(null); }}>Accept</button>
            <button type="button" onClick={() => setAsking(null)}>Cancel</button>
          </div>
        </Dialog>
      )}
    </>
  );
}
