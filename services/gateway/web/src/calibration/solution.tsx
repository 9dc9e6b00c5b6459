import { get } from "../api";
import { significant } from "../format";
import { useLoaded } from "../hooks";
import { Card, Tile } from "../parts/basics";
import { type Rig, RingView } from "./ring-view";
import { kVerdicts, type SessionState } from "./session-state";

// What the poses give so far, and how sure it is; the ring once everything was solved together.
export function Solution({ session }: { session: SessionState }) {
  const verdict = kVerdicts[session.verdict];
  const isFinal = session.state === "solved";
  const rig = useLoaded<Rig | null>(`found ${session.session} ${session.poses} ${isFinal}`, async (signal) => (isFinal ? get<Rig>("calibration/rig", signal) : null));
  if (!verdict) return null;
  const compared = session.previous_version > 0;
  return (
    <>
      <Card title={isFinal ? "Solution" : "Solution so far"} class={rig.value ? "" : "wide"} aside={<strong class={verdict.class}>{verdict.mark} {verdict.text}</strong>}>
        <div class="tiles">
          <Tile value={`${significant(session.volume_error_px.worst)} px`} name={`expected error in the volume, worst (${session.volume_error_px.camera})`} />
          <Tile value={`${significant(session.volume_error_px.mean)} px`} name="mean over the cameras" />
          <Tile value={`${significant(session.rms_px)} px`} name="RMS over all corners" />
        </div>
        {compared && (session.moved_cameras.length > 0
          ? <p class="fair">▲ Moved since calibration {session.previous_version}: {session.moved_cameras.join(", ")}</p>
          : <p class="good">✓ No camera moved since calibration {session.previous_version}.</p>)}
        <div class="scroll" tabIndex={0} role="region" aria-label="Solution by camera">
          <table>
            <thead><tr><th scope="col">Camera</th><th scope="col" class="n">Boards</th><th scope="col" class="n">Expected error (px)</th>{compared && <th scope="col" class="n">Shift since calibration {session.previous_version} (px)</th>}</tr></thead>
            <tbody>{session.cameras.map((c) => <tr key={c.name}><th scope="row">{c.name}</th><td class="n">{c.boards}</td><td class="n">{significant(c.expected_px)}</td>{compared && <td class={`n ${c.moved ? "fair" : ""}`}>{c.moved ? "▲ moved " : ""}{significant(c.shift_px)}</td>}</tr>)}</tbody>
          </table>
        </div>
      </Card>
      {rig.value && <Card title="Ring found" aside={<span class="dim">not yet accepted</span>}><RingView rig={rig.value} size_mm={[0, 0, 0]} /></Card>}
    </>
  );
}
