import type { Field } from "../api";
import type { MapName } from "../colour";

export interface Look {
  mode: "glow" | "brightest" | "surface" | "both";
  map: MapName;
  threshold: number; // share of the displayed range, below which all is clear
  opacity: number; // 0 to 1, of the brightest
  iso: number; // share of the displayed range
  clip: "none" | "x" | "y" | "z";
  clipAt: number; // 0 to 1 of the box
}
export const kFirstLook: Look = { mode: "glow", map: "inferno", threshold: 0.06, opacity: 0.7, iso: 0.4, clip: "none", clipAt: 0.5 };

export interface Shape {
  size: [number, number, number];
  spacing_mm: [number, number, number];
  origin_mm: [number, number, number];
}
export interface CameraPose {
  position: [number, number, number];
  focalPoint: [number, number, number];
  viewUp: [number, number, number];
}

export function shapeOf(field: Field): Shape {
  const { size, spacing_mm, origin_mm } = field.head;
  return { size, spacing_mm, origin_mm };
}

// The values of [low, high] as 0 to 255.
export function quantised(values: Float32Array, low: number, high: number): Uint8Array<ArrayBuffer> {
  const out = new Uint8Array(values.length);
  const scale = high > low ? 255 / (high - low) : 0;
  for (let i = 0; i < values.length; ++i) {
    const at = (values[i] - low) * scale;
    out[i] = at <= 0 ? 0 : at >= 255 ? 255 : at + 0.5;
  }
  return out;
}

export type AxisName = "x" | "y" | "z";
export interface SliceData {
  values: Float32Array; // rows from the top
  width: number;
  height: number;
  right: AxisName;
  up: AxisName;
  position_mm: number;
}
// normal x: z right, y up; normal y: x right, z up; normal z: x right, y up
export function sliceOf(field: Field, normal: AxisName, index: number): SliceData {
  const [nx, ny, nz] = field.head.size;
  const at = { x: 0, y: 1, z: 2 }[normal];
  const position_mm = field.head.origin_mm[at] + index * field.head.spacing_mm[at];
  const [right, up]: [AxisName, AxisName] = normal === "x" ? ["z", "y"] : normal === "y" ? ["x", "z"] : ["x", "y"];
  const sizes = { x: nx, y: ny, z: nz };
  const steps = { x: 1, y: nx, z: nx * ny };
  const width = sizes[right];
  const height = sizes[up];
  const values = new Float32Array(width * height);
  const base = index * steps[normal];
  for (let row = 0; row < height; ++row) {
    const start = base + (height - 1 - row) * steps[up];
    for (let column = 0; column < width; ++column) values[row * width + column] = field.values[start + column * steps[right]];
  }
  return { values, width, height, right, up, position_mm };
}

// Mean over each layer of one height, lowest first.
export function meanByHeight(field: Field): { height_mm: number[]; mean: number[] } {
  const [nx, ny, nz] = field.head.size;
  const mean = new Array<number>(ny).fill(0);
  for (let z = 0; z < nz; ++z)
    for (let y = 0; y < ny; ++y) {
      const start = (z * ny + y) * nx;
      for (let x = 0; x < nx; ++x) mean[y] += field.values[start + x];
    }
  const height_mm = mean.map((_, y) => field.head.origin_mm[1] + y * field.head.spacing_mm[1]);
  return { height_mm, mean: mean.map((sum) => sum / (nx * nz)) };
}
