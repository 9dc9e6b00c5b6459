import { useEffect, useState } from "preact/hooks";
import { get, type Recipe, type SettingValue, send, type Solvers } from "../api";
import { useLoaded } from "../hooks";
import { Card, Confirm, Loading, Problem } from "../parts/basics";
import { type Draft, kindOf, problemOf, RecipeForm } from "./recipe-form";

function settingOf(recipe: Draft, key: string, solvers: Solvers): SettingValue | undefined {
  if (key in recipe.settings) return recipe.settings[key];
  const [table] = key.split(".");
  const docs = solvers.solvers.find((s) => s.name === table)?.settings ?? solvers.shared.find((s) => s.table === table)?.settings ?? [];
  return docs.find((doc) => doc.key === key)?.default;
}

// What differs between two recipes; defaults count as values.
function Difference({ left, right, leftName, rightName, solvers }: { left: Draft; right: Draft; leftName: string; rightName: string; solvers: Solvers }) {
  const keys = [...new Set([...Object.keys(left.settings), ...Object.keys(right.settings)])].sort();
  const rows = keys.map((key) => [key, settingOf(left, key, solvers), settingOf(right, key, solvers)] as const).filter(([, a, b]) => String(a) !== String(b));
  if (left.solver !== right.solver) rows.unshift(["solver", left.solver, right.solver]);
  if (rows.length === 0) return <p role="status">The two are equal.</p>;
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label="Differences">
      <table>
        <thead><tr><th scope="col">Setting</th><th scope="col">{leftName}</th><th scope="col">{rightName}</th></tr></thead>
        <tbody>{rows.map(([key, a, b]) => <tr key={key}><th scope="row"><code>{key}</code></th><td>{String(a ?? "–")}</td><td>{String(b ?? "–")}</td></tr>)}</tbody>
      </table>
    </div>
  );
}

export function RecipesPage() {
  const solvers = useLoaded<Solvers>("solvers", (signal) => get("solvers", signal));
  const [turn, setTurn] = useState(0);
  const recipes = useLoaded<{ recipes: Recipe[] }>(`recipes ${turn}`, (signal) => get("recipes", signal));
  const [name, setName] = useState("");
  const [other, setOther] = useState("");
  const [draft, setDraft] = useState<Draft>({ solver: "hessian", settings: {} });
  const [saveAs, setSaveAs] = useState("my-recipe");
  const [problem, setProblem] = useState("");
  const [told, setTold] = useState("");
  const [deleting, setDeleting] = useState(false);
  const all = recipes.value?.recipes ?? [];
  const chosen = all.find((r) => r.name === name);
  useEffect(() => {
    if (!chosen || chosen.error) return;
    setDraft({ solver: chosen.solver, settings: chosen.settings });
    setSaveAs(chosen.is_shipped ? `my-${chosen.name}` : chosen.name);
  }, [chosen?.name, chosen?.fingerprint]);
  if (solvers.error) return <Problem text={solvers.error} again={solvers.again} />;
  if (!solvers.value || !recipes.value) return recipes.error ? <Problem text={recipes.error} again={recipes.again} /> : <Loading what="recipes" />;
  const docs = [...(solvers.value.solvers.find((s) => s.name === draft.solver)?.settings ?? []), ...solvers.value.shared.flatMap((s) => s.settings)];
  const wrong = docs.filter((doc) => doc.key in draft.settings && problemOf(doc, draft.settings[doc.key]) !== "" && kindOf(doc).type === "number");
  const nameWrong = !/^[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}$/.test(saveAs);
  const taken = all.some((r) => r.name === saveAs && r.is_shipped);
  const act = async (task: Promise<unknown>, then: string) => {
    setProblem("");
    setTold("");
    try {
      await task;
      setTold(then);
      setTurn(turn + 1);
    } catch (error) {
      setProblem((error as Error).message);
    }
  };
  const compared = all.find((r) => r.name === other);
  return (
    <div class="recipes-page">
      <Card title="Recipes">
        <ul class="choices">
          <li><button type="button" aria-pressed={name === ""} onClick={() => { setName(""); setDraft({ solver: "hessian", settings: {} }); setSaveAs("my-recipe"); }}><strong>Defaults</strong><span class="dim">hessian</span></button></li>
          {all.map((r) => <li key={r.name}><button type="button" aria-pressed={name === r.name} onClick={() => { setName(r.name); setTold(""); setProblem(""); }}>
            <strong>{r.name}</strong><span class={r.error ? "poor" : "dim"}>{r.error ? "✗ damaged" : `${r.solver}${r.is_shipped ? " · shipped" : ""}`}</span></button></li>)}
        </ul>
      </Card>
      <Card title={name || "New recipe"} class="grow" aside={chosen && !chosen.error && <span class="dim">fingerprint {chosen.fingerprint}</span>}>
        {chosen?.error && <Problem text={chosen.error} />}
        <RecipeForm solvers={solvers.value} draft={draft} change={(next) => { setDraft(next); setTold(""); }} />
        <div class="buttons">
          <label>Save as <input value={saveAs} aria-invalid={nameWrong || taken} onInput={(e) => setSaveAs(e.currentTarget.value)} /></label>
          <button type="button" class="primary" disabled={wrong.length > 0 || nameWrong || taken}
            onClick={() => act(send("PUT", `recipes/${encodeURIComponent(saveAs)}`, draft).then(() => setName(saveAs)), `Saved as ${saveAs}.`)}>Save</button>
          {chosen && !chosen.is_shipped && <button type="button" class="danger" onClick={() => setDeleting(true)}>Delete …</button>}
          <span role="status" class="good">{told && `✓ ${told}`}</span>
        </div>
        {taken && <p class="note">Recipes that came with the program keep their names.</p>}
        {wrong.length > 0 && <Problem text={`${wrong.map((doc) => doc.key).join(", ")}: out of range.`} />}
        {problem && <Problem text={problem} />}
        {deleting && chosen && <Confirm title={`Delete ${chosen.name}?`} act="Delete" onClose={() => setDeleting(false)}
          onAct={() => act(send("DELETE", `recipes/${encodeURIComponent(chosen.name)}`).then(() => setName("")), "Deleted.")}>Runs keep the settings that they were made with.</Confirm>}
      </Card>
      <Card title="Difference">
        <label>Compare with
          <select value={other} onChange={(e) => setOther(e.currentTarget.value)}>
            <option value="">…</option>
            {all.filter((r) => !r.error).map((r) => <option key={r.name}>{r.name}</option>)}
          </select>
        </label>
        {compared ? <Difference left={draft} right={compared} leftName={name || "new"} rightName={compared.name} solvers={solvers.value} /> : <p class="note">Choose a second recipe to see what differs.</p>}
      </Card>
    </div>
  );
}
