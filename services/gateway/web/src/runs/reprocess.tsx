import { useState } from "preact/hooks";
import { type Estimate, get, type Jobs, type Recipe, type RunLine, send, type Solvers, type Submitted } from "../api";
import { count, duration } from "../format";
import { useInterval, useLoaded } from "../hooks";
import { Dialog, Loading, Problem } from "../parts/basics";
import { type Draft, RecipeForm } from "../recipes/recipe-form";

// The progress of what was submitted; it goes on without us.
export function JobsProgress({ submitted, onDone }: { submitted: Submitted; onDone?: () => void }) {
  const [jobs, setJobs] = useState<Jobs | null>(null);
  const [problem, setProblem] = useState("");
  const all = submitted.jobs.length;
  const done = (jobs?.done ?? 0) + (jobs?.failed ?? 0);
  const open = all > 0 && done < all;
  useInterval(open ? 500 : 3_600_000, () => {
    if (!open) return;
    get<Jobs>(`jobs?first=${Math.min(...submitted.jobs)}&last=${Math.max(...submitted.jobs)}&limit=20`).then(
      (answer) => {
        setProblem("");
        setJobs(answer);
        if (answer.done + answer.failed >= all) onDone?.();
      },
      (error: Error) => setProblem(error.message),
    );
  });
  if (all === 0) return <p role="status">All {count(submitted.identical)} were already there: the same work is not done twice. {submitted.runs[0] && <a href={`#/runs/${encodeURIComponent(submitted.runs[0])}`}>Show</a>}</p>;
  const failed = jobs?.jobs.filter((job) => job.state === "failed") ?? [];
  return (
    <div class="progress">
      <label>{open ? "Reconstructing" : "Done"}: {count(done)} of {count(all)}{submitted.identical > 0 ? ` (${count(submitted.identical)} were already there)` : ""}
        <progress value={done} max={all} />
      </label>
      {problem && <Problem text={problem} />}
      {failed.length > 0 && <Problem text={`${count(jobs?.failed ?? 0)} failed, e.g. ${failed[0].run}: ${failed[0].reason}`} />}
      {!open && submitted.runs[0] && <p role="status">✓ <a href={`#/runs/${encodeURIComponent(submitted.runs[0])}`}>{all === 1 ? "Show the result" : "Show the first result"}</a></p>}
    </div>
  );
}

export function Reprocess({ runs, onClose, onDone }: { runs: RunLine[]; onClose: () => void; onDone: () => void }) {
  const solvers = useLoaded<Solvers>("solvers", (signal) => get("solvers", signal));
  const recipes = useLoaded<{ recipes: Recipe[] }>("recipes", (signal) => get("recipes", signal));
  const [draft, setDraft] = useState<Draft>({ solver: runs[0]?.solver ?? "hessian", settings: {} });
  const [estimate, setEstimate] = useState<Estimate | null>(null);
  const [submitted, setSubmitted] = useState<Submitted | null>(null);
  const [preview, setPreview] = useState<Submitted | null>(null);
  const [problem, setProblem] = useState("");
  const [busy, setBusy] = useState(false);
  const ask = async <T,>(path: string, more: object, then: (answer: T) => void) => {
    setBusy(true);
    setProblem("");
    try {
      then(await send<T>("POST", path, { runs: runs.map((run) => run.id), ...draft, ...more }));
    } catch (error) {
      setProblem((error as Error).message);
    } finally {
      setBusy(false);
    }
  };
  const change = (next: Draft) => {
    setDraft(next);
    setEstimate(null);
    setPreview(null);
  };
  return (
    <Dialog title={`Reprocess ${count(runs.length)} ${runs.length === 1 ? "run" : "runs"}`} onClose={onClose}>
      {solvers.error && <Problem text={solvers.error} again={solvers.again} />}
      {!solvers.value && !solvers.error && <Loading what="solvers" />}
      {solvers.value && !submitted && (
        <>
          <label>Start from
            <select onChange={(e) => {
              const recipe = recipes.value?.recipes.find((r) => r.name === e.currentTarget.value);
              if (recipe && !recipe.error) change({ solver: recipe.solver, settings: recipe.settings });
            }}>
              <option value="">a solver's defaults</option>
              {(recipes.value?.recipes ?? []).filter((r) => !r.error).map((r) => <option key={r.name} value={r.name}>recipe {r.name}</option>)}
            </select>
          </label>
          <RecipeForm solvers={solvers.value} draft={draft} change={change} />
          {estimate && <p role="status">{estimate.identical > 0 && `${count(estimate.identical)} are there already. `}{count(estimate.volumes)} volumes on {estimate.workers} workers{estimate.volumes === 0 ? "." : estimate.seconds_in_all === null ? ": this solver was never run here, so its time is not known. Try one set first." : `: about ${duration(estimate.seconds_in_all)} (${duration(estimate.seconds_each)} each), ${count(Math.round(estimate.peak_rss_mib ?? 0))} MiB.`}</p>}
          {preview && <JobsProgress submitted={preview} />}
          <div class="buttons">
            <button type="button" class="primary" disabled={busy} onClick={() => ask<Submitted>("reprocess", {}, setSubmitted)}>Reprocess</button>
            <button type="button" disabled={busy} onClick={() => ask<Submitted>("reprocess", { only_first: true }, setPreview)}>Try one set</button>
            <button type="button" disabled={busy} onClick={() => ask<Estimate>("reprocess/estimate", {}, setEstimate)}>Estimate</button>
            <button type="button" class="quiet" onClick={onClose}>Cancel</button>
          </div>
        </>
      )}
      {submitted && <>
        <JobsProgress submitted={submitted} onDone={onDone} />
        <div class="buttons"><button type="button" onClick={onClose}>Close</button></div>
      </>}
      {problem && <Problem text={problem} />}
    </Dialog>
  );
}
