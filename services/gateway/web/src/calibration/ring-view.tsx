export interface RigCamera {
  name: string;
  width_px: number;
  height_px: number;
  fx_px: number;
  fy_px: number;
  centre_mm: [number, number, number];
  axis: [number, number, number];
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

function Projection({ rig, right, up, flip, title, size_mm, middle }: { rig: Rig; right: number; up: number; flip: number; title: string; size_mm: number[]; middle: number[] }) {
  const reach = 1.25 * Math.max(...rig.cameras.flatMap((c) => [Math.abs(c.centre_mm[right] - middle[right]), Math.abs(c.centre_mm[up] - middle[up]), 60]));
  const x = (mm: number) => mm - middle[right];
  const y = (mm: number) => flip * (mm - middle[up]);
  const tick = reach / 14;
  return (
    <figure>
      <svg viewBox={`${-reach} ${-reach} ${2 * reach} ${2 * reach}`} class="ring" role="img" aria-label={title}>
        <rect x={-size_mm[right] / 2} y={-size_mm[up] / 2} width={size_mm[right]} height={size_mm[up]} class="box" />
        {rig.cameras.map((c) => {
          const cx = x(c.centre_mm[right]);
          const cy = y(c.centre_mm[up]);
          const length = Math.hypot(...c.axis) * reach * 0.22;
          const sigma = 100 * (c.position_sigma_mm ?? 0);
          return (
            <g key={c.name}>
              <line x1={cx} y1={cy} x2={cx + length * c.axis[right]} y2={cy + flip * length * c.axis[up]} class="sight" />
              {sigma > 0 && <circle cx={cx} cy={cy} r={sigma} class="sigma" />}
              <circle cx={cx} cy={cy} r={tick * 0.28} class="camera" />
              {title.includes("above") && <text x={cx + (reach * 0.11 * cx) / Math.max(Math.hypot(cx, cy), 1)} y={cy + (reach * 0.07 * cy) / Math.max(Math.hypot(cx, cy), 1)} font-size={tick * 0.8} text-anchor="middle" dominant-baseline="middle">{c.name}</text>}
            </g>
          );
        })}
      </svg>
      <figcaption>{title}</figcaption>
    </figure>
  );
}

// Two flat views say more about a ring than one in perspective.
export function RingView({ rig, size_mm }: { rig: Rig; size_mm: number[] }) {
  const mean = (axis: number) => rig.cameras.reduce((sum, c) => sum + c.centre_mm[axis], 0) / Math.max(rig.cameras.length, 1);
  const middle = [0, mean(1), 0];
  return (
    <div class="ring-views">
      <Projection rig={rig} right={0} up={2} flip={1} title="from above (x right, z down)" size_mm={size_mm} middle={middle} />
      <Projection rig={rig} right={0} up={1} flip={-1} title="from the side (x right, height up)" size_mm={size_mm} middle={middle} />
    </div>
  );
}
