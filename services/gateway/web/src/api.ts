// The API as the pages use it; /api/v1/openapi.json describes it. Nothing else is asked of the server.

export interface CameraState {
  name: string;
  address: string;
  connected: boolean;
  frames: number;
  losses: Record<string, number>;
  newest_age_s: number | null;
}
export interface ArrayState {
  phase: string;
  capture: string;
  kind: string;
  pulses_wanted: number;
  sets: number;
  sets_stored: number;
  cameras: CameraState[];
}
export interface Alarm {
  severe: boolean;
  what: string;
  text: string;
}
export interface Status {
  topic: "status";
  time_ns: number;
  array: ArrayState | null;
  dispatcher: {
    program_version: string;
    sets: number;
    runs: number;
    queued: number;
    leased: number;
    done: number;
    failed: number;
    workers: { name: string; job: number | null; silent_s: number }[];
  } | null;
  counters: { pulses: number; sets: number; volumes: number; queued: number; failed: number; lost_frames: number };
  sets_per_s: number;
  newest_run: string | null;
  disk: { free_bytes: number | null; bytes_per_s: number; seconds_to_full: number | null };
  alarms: Alarm[];
  report: string | null;
}

export interface FrameInfo {
  name: string;
  pulse: number;
  bits: number;
  exposure_us: number;
  full_width: number;
  full_height: number;
  arrival_time_ns: number;
  max: number;
  mean: number;
  saturated: number;
  histogram: number[];
}
export interface ThumbnailInfo extends FrameInfo {
  width: number;
  height: number;
  scale: number;
  offset: number;
}
export interface SetHead {
  topic: string;
  capture: string;
  kind: string;
  pulse: number;
  index: number;
  pulse_time_ns: number;
  complete_time_ns: number;
}
export interface ThumbnailsHead extends SetHead {
  losses: { camera: string; cause: string }[];
  cameras: ThumbnailInfo[];
}
export interface FrameHead extends SetHead {
  camera: FrameInfo;
}
export interface VolumeHead {
  topic: "volume";
  run: string;
  capture: string;
  index: number;
  inputs: number;
  solver: string;
  size: [number, number, number];
  spacing_mm: [number, number, number];
  origin_mm: [number, number, number];
  full_size: [number, number, number];
  low: number;
  high: number;
  bits: number;
  pulse_time_ns: number;
  committed_time_ns: number;
  is_unfinished: boolean; // the best so far of an evolution that goes on
}
export interface Message<Head> {
  head: Head;
  payload: Uint8Array;
}

// "FFW1", header length, JSON header, payload at a multiple of 8 bytes.
export function unframed<Head>(bytes: ArrayBuffer): Message<Head> {
  const view = new DataView(bytes);
  if (bytes.byteLength < 8 || view.getUint32(0) !== 0x46465731) throw new Error("not a flamefield message");
  const length = view.getUint32(4, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 8, length))) as Head;
  return { head, payload: new Uint8Array(bytes, 8 + length) };
}

export interface Field {
  head: VolumeHead;
  values: Float32Array; // (nz, ny, nx), x fastest
}
export function fieldOf(message: Message<VolumeHead>): Field {
  const { head, payload } = message;
  const full = head.bits > 8 ? 65535 : 255;
  const stored = head.bits > 8 ? new Uint16Array(payload.buffer, payload.byteOffset, payload.byteLength / 2) : payload;
  const values = new Float32Array(stored.length);
  const step = (head.high - head.low) / full;
  for (let i = 0; i < stored.length; ++i) values[i] = head.low + step * stored[i];
  return { head, values };
}

export interface RunLine {
  id: string;
  capture: string;
  index: number;
  inputs: number;
  solver: string;
  worker: string;
  rig: string;
  iterations: number;
  residual: number;
  volume_bytes: number;
  duration_s: number;
  finished: string;
}
export interface RunsPage {
  total: number;
  offset: number;
  solvers: string[];
  runs: RunLine[];
}
export interface Run {
  id: string;
  inputs: { capture: string; index: number }[];
  solver: string;
  settings: Record<string, string | number | boolean>;
  recipe: string;
  rig: string;
  program_version: string;
  worker: string;
  volume: string;
  volume_bytes: number;
  volume_fingerprint: string;
  projections: string;
  iterations: number;
  residual: number;
  residual_per_view: Record<string, number>;
  stop_reason: string;
  projector_engine: string;
  metrics: Record<string, number>;
  provenance: string[];
  history: { iteration: number; residual: number; elapsed_s: number; fitness?: number }[];
  queue_s: number;
  fetch_s: number;
  prepare_s: number;
  solve_s: number;
  write_s: number;
  dark: string;
  background: string;
  flat: string;
  size: [number, number, number];
  spacing_mm: [number, number, number];
  started: string;
  finished: string;
}
export interface Receipt {
  capture: string;
  kind: string;
  pulses: number;
  sets: number;
  volumes: number;
  failed: number;
  pending: number;
  not_asked: number;
  cameras: { camera: string; pulses: number; frames: number; losses: Record<string, number>; balances: boolean }[];
  failures: { run: string; reason: string }[];
  balances: boolean;
}
export interface SettingDoc {
  key: string;
  unit: string;
  range: string;
  default: string;
  doc: string;
}
export interface Solvers {
  solvers: { name: string; summary: string; settings: SettingDoc[] }[];
  shared: { table: string; settings: SettingDoc[] }[];
}
export type SettingValue = string | number | boolean;
export interface Recipe {
  name: string;
  is_shipped: boolean;
  solver: string;
  settings: Record<string, SettingValue>;
  fingerprint: string;
  toml: string;
  error?: string;
}
export interface Submitted {
  jobs: number[];
  runs: string[];
  identical: number;
}
export interface Estimate {
  volumes: number;
  identical: number;
  workers: number;
  seconds_each: number | null;
  seconds_in_all: number | null;
  peak_rss_mib: number | null;
}
export interface Jobs {
  queued: number;
  leased: number;
  done: number;
  failed: number;
  jobs: { job: number; run: string; state: string; attempt: number; worker: string; reason: string }[];
}

export class ApiError extends Error {
  constructor(
    readonly status: number,
    message: string,
  ) {
    super(message);
  }
}

async function asked(path: string, init: RequestInit): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(`/api/v1/${path}`, init);
  } catch (problem) {
    if (init.signal?.aborted) throw problem;
    throw new ApiError(0, "flamefield does not answer. Is it running?");
  }
  if (answer.ok) return answer;
  const text = await answer.text();
  let message = text || answer.statusText;
  try {
    message = (JSON.parse(text) as { error: string }).error;
  } catch {
    // the text itself will do
  }
  throw new ApiError(answer.status, message);
}

export async function get<Answer>(path: string, signal?: AbortSignal): Promise<Answer> {
  return (await (await asked(path, { signal, cache: "no-store" })).json()) as Answer;
}
export async function getMessage<Head>(path: string, signal?: AbortSignal): Promise<Message<Head>> {
  return unframed<Head>(await (await asked(path, { signal })).arrayBuffer());
}
export async function getField(run: string, bits = 8, side = 96, signal?: AbortSignal): Promise<Field> {
  const path = `runs/${encodeURIComponent(run)}/volume?bits=${bits}&max_side=${side}`;
  return fieldOf(await getMessage<VolumeHead>(path, signal));
}

// A command. The cookie that came with the page is the key; after a restart of the server the page fetches a new one.
export async function send<Answer>(method: "POST" | "PUT" | "DELETE", path: string, body: unknown = {}): Promise<Answer> {
  const init: RequestInit = { method, headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
  try {
    return (await (await asked(path, init)).json()) as Answer;
  } catch (problem) {
    if (!(problem instanceof ApiError) || problem.status !== 403) throw problem;
    await fetch("/", { cache: "no-store" });
    return (await (await asked(path, init)).json()) as Answer;
  }
}
