export interface SessionCamera {
  name: string;
  sees_board: boolean;
  last_reason: string;
  corners_px: number[];
  boards: number;
  coverage: number;
  covered: boolean[];
  region_px: number[];
  expected_px: number | null;
  shift_px: number | null;
  moved: boolean;
}
export interface SessionState {
  state: "idle" | "detecting" | "solving" | "solved";
  session: string;
  automatic: boolean;
  poses: number;
  wanted_poses: number;
  still: boolean;
  new: boolean;
  message: string;
  error: string;
  cameras: SessionCamera[];
  needed: string[];
  links_missing: { a: string; b: string }[];
  volume_coverage: number;
  verdict: string;
  rms_px: number;
  volume_error_px: { mean: number; worst: number; camera: string };
  previous_version: number;
  moved_cameras: string[];
  accepted_version: number;
  report: string;
  board: string;
}
// Where no service holds sessions.
export interface Unavailable {
  state: "unavailable";
  why: string;
}
export interface Accepted {
  version: number;
  predecessor: number | null;
  rig_id: string;
  accepted_time_ns: number;
  accepted_by: string;
  note: string;
  capture: string;
  poses: number;
  rms_px: number;
  volume_error_px: { mean: number; worst: number; camera: string };
  verdict: string;
  moved_cameras: string[];
  worst_shift_px: number | null;
  most_shifted: string;
}
export const kVerdicts: Record<string, { mark: string; class: string; text: string }> = {
  green: { mark: "✓", class: "good", text: "good" },
  amber: { mark: "▲", class: "fair", text: "usable, look at the report" },
  red: { mark: "✗", class: "poor", text: "not good enough" },
};
