import type { SettingDoc, SettingValue, Solvers } from "../api";

export interface Draft {
  solver: string;
  settings: Record<string, SettingValue>;
}

type Kind = { type: "bool" } | { type: "choice"; names: string[] } | { type: "number"; low: number; high: number; whole: boolean };

// The solver's own words about a setting, as the command line prints them.
export function kindOf(doc: SettingDoc): Kind {
  if (doc.range === "true or false") return { type: "bool" };
  const span = /^(\S+) \.\. (\S+)$/.exec(doc.range);
  const above = /^>= (\S+)$/.exec(doc.range);
  if (!span && !above) return { type: "choice", names: doc.range.split(" | ") };
  return { type: "number", low: Number(span ? span[1] : above?.[1]), high: span ? Number(span[2]) : Infinity, whole: false };
}

export function problemOf(doc: SettingDoc, value: SettingValue): string {
  const kind = kindOf(doc);
  if (kind.type !== "number") return "";
  if (typeof value !== "number" || !Number.isFinite(value)) return "must be a number";
  return value < kind.low || value > kind.high ? `must be ${doc.range}${doc.unit ? ` ${doc.unit}` : ""}` : "";
}

function parsed(doc: SettingDoc): SettingValue {
  const kind = kindOf(doc);
  return kind.type === "bool" ? doc.default === "true" : kind.type === "number" ? Number(doc.default) : doc.default;
}

function Field({ doc, value, set }: { doc: SettingDoc; value: SettingValue | undefined; set: (value: SettingValue | undefined) => void }) {
  const kind = kindOf(doc);
  const changed = value !== undefined;
  const shown = value ?? parsed(doc);
  const problem = changed ? problemOf(doc, value) : "";
  const id = `setting-${doc.key}`;
  return (
    <div class={`setting ${changed ? "changed" : ""}`}>
      <label for={id}><code>{doc.key.split(".")[1]}</code>{changed && <span class="pill small">changed</span>}</label>
      <span class="line">
        {kind.type === "bool" && <input id={id} type="checkbox" checked={shown === true} aria-describedby={`${id}-doc`} onChange={(e) => set(e.currentTarget.checked)} />}
        {kind.type === "choice" && <select id={id} value={String(shown)} aria-describedby={`${id}-doc`} onChange={(e) => set(e.currentTarget.value)}>{kind.names.map((name) => <option key={name}>{name}</option>)}</select>}
        {kind.type === "number" && <input id={id} type="number" step="any" min={kind.low} max={Number.isFinite(kind.high) ? kind.high : undefined} value={String(shown)} aria-invalid={problem !== ""} aria-describedby={`${id}-doc`} onInput={(e) => set(e.currentTarget.value === "" ? undefined : Number(e.currentTarget.value))} />}
        {doc.unit && <span class="dim">{doc.unit}</span>}
        {changed && <button type="button" class="quiet" onClick={() => set(undefined)} title={`Back to ${doc.default}`} aria-label={`${doc.key} back to its default, ${doc.default}`}>↺</button>}
      </span>
      <p id={`${id}-doc`} class="note">{problem ? <strong class="poor">✗ {problem}. </strong> : null}{doc.doc} <span class="dim">({doc.range}{doc.unit ? ` ${doc.unit}` : ""}; default {doc.default})</span></p>
    </div>
  );
}

export function RecipeForm({ solvers, draft, change, readOnly = false }: { solvers: Solvers; draft: Draft; change: (draft: Draft) => void; readOnly?: boolean }) {
  const solver = solvers.solvers.find((s) => s.name === draft.solver);
  const set = (key: string) => (value: SettingValue | undefined) => {
    const settings = { ...draft.settings };
    if (value === undefined) delete settings[key];
    else settings[key] = value;
    change({ ...draft, settings });
  };
  const group = (title: string, docs: SettingDoc[], open: boolean) => {
    const changed = docs.filter((doc) => doc.key in draft.settings).length;
    return docs.length > 0 && (
      <details key={title} open={open || changed > 0}>
        <summary>{title}{changed > 0 ? ` (${changed} changed)` : ""}</summary>
        <div class="settings">{docs.map((doc) => <Field key={doc.key} doc={doc} value={draft.settings[doc.key]} set={set(doc.key)} />)}</div>
      </details>
    );
  };
  return (
    <fieldset class="recipe-form" disabled={readOnly}>
      <label>Solver
        <select value={draft.solver} onChange={(e) => change({ solver: e.currentTarget.value, settings: Object.fromEntries(Object.entries(draft.settings).filter(([key]) => !key.startsWith(`${draft.solver}.`))) })}>
          {solvers.solvers.map((s) => <option key={s.name}>{s.name}</option>)}
        </select>
      </label>
      <p class="note">{solver?.summary}</p>
      {group(draft.solver, solver?.settings ?? [], true)}
      {solvers.shared.map((table) => group(table.table, table.settings, false))}
    </fieldset>
  );
}
