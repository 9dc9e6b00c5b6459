import { useState } from "preact/hooks";
import { significant } from "../format";

export type Triple = [number, number, number];
export interface RigCamera {
  name: string;
  width_px: number;
  height_px: number;
  fx_px: number;
  fy_px: number;
  centre_mm: Triple;
  axis: Triple;
  up: Triple;
  images?: number;
  corners?: number;
  rejected_corners?: number;
  rms_px?: number;
  position_sigma_mm?: number;
  rotation_sigma_rad?: number;
  focal_sigma_px?: number;
}
export interface Rig {
  id: string;
  rms_px: number | null;
  board_poses: number | null;
  cameras: RigCamera[];
}

const plus = (a: Triple, b: Triple, by = 1): Triple => [a[0] + by * b[0], a[1] + by * b[1], a[2] + by * b[2]];
const cross = (a: Triple, b: Triple): Triple => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a: Triple, b: Triple): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const circle = (radius: number, y: number, middle: Triple): Triple[] => Array.from({ length: 73 }, (_, i) => [middle[0] + radius * Math.cos((i * Math.PI) / 36), y, middle[2] + radius * Math.sin((i * Math.PI) / 36)]);

// Where the viewer stands: azimuth about the burner's axis, height above its plane (rad).
interface Eye {
  azimuth: number;
  height: number;
}
const kViews: [string, Eye][] = [["in space", { azimuth: -0.5, height: 0.5 }], ["from above", { azimuth: 0, height: Math.PI / 2 }], ["from the side", { azimuth: 0, height: 0 }]];

// Without perspective, so that lengths may be compared. (x right, y down, depth away from the viewer)
function projector(eye: Eye, middle: Triple): (p: Triple) => Triple {
  const [ca, sa, ch, sh] = [Math.cos(eye.azimuth), Math.sin(eye.azimuth), Math.cos(eye.height), Math.sin(eye.height)];
  return (p) => {
    const [x, y, z] = [p[0] - middle[0], p[1] - middle[1], p[2] - middle[2]];
    const right = ca * x + sa * z;
    const near = -sa * x + ca * z;
    return [right, -(ch * y - sh * near), -(sh * y + ch * near)];
  };
}

// The corners of what a camera sees at a distance from it.
function frustum(camera: RigCamera, length_mm: number): Triple[] {
  const right = cross(camera.axis, camera.up);
  const half = [(length_mm * camera.width_px) / (2 * camera.fx_px), (length_mm * camera.height_px) / (2 * camera.fy_px)];
  const middle = plus(camera.centre_mm, camera.axis, length_mm);
  return [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) => plus(plus(middle, right, x * half[0]), camera.up, y * half[1]));
}

// By how much uncertainties are drawn larger than they are, so that the largest can be seen and none hides the ring.
function magnification(cameras: RigCamera[], reach_mm: number): number {
  const largest = Math.max(...cameras.map((c) => c.position_sigma_mm ?? 0));
  if (!(largest > 0)) return 0;
  const power = 10 ** Math.floor(Math.log10((0.07 * reach_mm) / largest));
  return Math.max(1, power * ([5, 2].find((n) => n * power * largest <= 0.07 * reach_mm) ?? 1));
}

function CameraMark({ camera, project, reach, magnified }: { camera: RigCamera; project: (p: Triple) => Triple; reach: number; magnified: number }) {
  const [cx, cy] = project(camera.centre_mm);
  const corners = frustum(camera, 0.16 * reach).map(project);
  const outline = corners.map(([x, y]) => `${x},${y}`).join(" ");
  const [tx, ty] = project(plus(camera.centre_mm, camera.axis, -0.09 * reach));
  const sigma = magnified * (camera.position_sigma_mm ?? 0);
  const [ax, ay] = project(plus(camera.centre_mm, camera.axis, dot(camera.axis, plus([0, 0, 0], camera.centre_mm, -1))));
  return (
    <g>
      <title>{`${camera.name}: at ${camera.centre_mm.map((v) => v.toFixed(1)).join(", ")} mm${camera.position_sigma_mm === undefined ? "" : `, ± ${significant(camera.position_sigma_mm)} mm, ± ${significant(1000 * (camera.rotation_sigma_rad ?? 0))} mrad`}`}</title>
      <line x1={cx} y1={cy} x2={ax} y2={ay} class="sight" />
      {corners.map(([x, y], i) => <line key={i} x1={cx} y1={cy} x2={x} y2={y} class="frustum" />)}
      <polygon points={outline} class="frustum" />
      {sigma > 0 && <circle cx={cx} cy={cy} r={sigma} class="sigma" />}
      <circle cx={cx} cy={cy} r={reach * 0.012} class="camera" />
      <text x={tx} y={ty} font-size={reach * 0.042} text-anchor="middle" dominant-baseline="middle">{camera.name}</text>
    </g>
  );
}

// The ring in space, to be turned with the mouse or the arrow keys.
export function RingView({ rig, size_mm }: { rig: Rig; size_mm: number[] }) {
  const [eye, setEye] = useState(kViews[0][1]);
  const [held, setHeld] = useState<{ x: number; y: number; eye: Eye } | null>(null);
  const height = rig.cameras.reduce((sum, c) => sum + c.centre_mm[1], 0) / Math.max(rig.cameras.length, 1);
  const middle: Triple = [0, height, 0];
  const reach = 1.2 * Math.max(60, ...rig.cameras.map((c) => Math.hypot(...plus(c.centre_mm, middle, -1))));
  const radius = rig.cameras.reduce((sum, c) => sum + Math.hypot(c.centre_mm[0], c.centre_mm[2]), 0) / Math.max(rig.cameras.length, 1);
  const project = projector(eye, middle);
  const magnified = magnification(rig.cameras, reach);
  const path = (points: Triple[]) => points.map(project).map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(2)} ${y.toFixed(2)}`).join("");
  const half = size_mm.map((v) => v / 2);
  const box: Triple[][] = half[0] > 0 ? [[-1, -1], [-1, 1], [1, -1], [1, 1]].flatMap(([a, b]) => [
    [[-half[0], height + a * half[1], b * half[2]], [half[0], height + a * half[1], b * half[2]]],
    [[a * half[0], height - half[1], b * half[2]], [a * half[0], height + half[1], b * half[2]]],
    [[a * half[0], height + b * half[1], -half[2]], [a * half[0], height + b * half[1], half[2]]],
  ] as Triple[][]) : [circle(30, height - 40, middle), circle(30, height + 40, middle), [[-30, height - 40, 0], [-30, height + 40, 0]], [[30, height - 40, 0], [30, height + 40, 0]], [[0, height - 40, -30], [0, height + 40, -30]], [[0, height - 40, 30], [0, height + 40, 30]]];
  const turn = (azimuth: number, up: number) => setEye((old) => ({ azimuth: old.azimuth + azimuth, height: Math.min(Math.PI / 2, Math.max(-Math.PI / 2, old.height + up)) }));
  const keys: Record<string, [number, number]> = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
  const ordered = [...rig.cameras].sort((a, b) => project(b.centre_mm)[2] - project(a.centre_mm)[2]);
  return (
    <div class="ring-view">
      <div
        class="ring-space" tabIndex={0} role="application" aria-label="The ring in space. Arrow keys turn it."
        onKeyDown={(event) => { const step = keys[event.key]; if (step) { event.preventDefault(); turn(...step); } }}
        onPointerDown={(event) => { event.currentTarget.setPointerCapture(event.pointerId); setHeld({ x: event.clientX, y: event.clientY, eye }); }}
        onPointerMove={(event) => held && setEye({ azimuth: held.eye.azimuth - (event.clientX - held.x) / 150, height: Math.min(Math.PI / 2, Math.max(-Math.PI / 2, held.eye.height + (event.clientY - held.y) / 150)) })}
        onPointerUp={() => setHeld(null)} onPointerCancel={() => setHeld(null)}
      >
        <svg viewBox={`${-reach} ${-0.72 * reach} ${2 * reach} ${1.44 * reach}`} class="ring" role="img" aria-label={`${rig.cameras.length} cameras around the burner, ${radius.toFixed(0)} mm from its axis on average`}>
          <path d={path(circle(radius, height, middle))} class="floor" />
          <path d={path([[0, height - 0.35 * reach, 0], [0, height + 0.35 * reach, 0]])} class="floor" />
          <path d={box.map(path).join("")} class="box" />
          {ordered.map((camera) => <CameraMark key={camera.name} camera={camera} project={project} reach={reach} magnified={magnified} />)}
        </svg>
      </div>
      <div class="buttons">
        {kViews.map(([name, view]) => <button type="button" key={name} aria-pressed={view.azimuth === eye.azimuth && view.height === eye.height} onClick={() => setEye(view)}>{name}</button>)}
        <span class="note">{magnified > 0 ? `Dashed circles: standard deviation of a camera's position, ${magnified} times as large.` : "Nothing is known about the errors of this rig."}</span>
      </div>
    </div>
  );
}
