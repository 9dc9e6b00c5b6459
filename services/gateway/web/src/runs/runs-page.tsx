import { useEffect, useRef, useState } from "preact/hooks";
import { get, type RunLine, type RunsPage as Page } from "../api";
import { count } from "../format";
import { useLoaded, useStatus } from "../hooks";
import { Empty, Problem } from "../parts/basics";
import { Reprocess } from "./reprocess";
import { type Filter, queryOf, RunTable } from "./run-table";

interface Captures {
  captures: { capture: string; kind: string; sets: number }[];
}

export function RunsPage() {
  const [filter, setFilter] = useState<Filter>({ search: "", solver: "", capture: "", sort: "finished", order: "desc" });
  const [search, setSearch] = useState("");
  const [turn, setTurn] = useState(0);
  const [ticked, setTicked] = useState(new Map<string, RunLine>());
  const [page, setPage] = useState<Page | null>(null);
  const [reprocessing, setReprocessing] = useState(false);
  const captures = useLoaded<Captures>(`captures ${turn}`, (signal) => get("captures", signal));
  const first = useLoaded<Page>(`first ${queryOf(filter)} ${turn}`, (signal) => get(`runs?${queryOf(filter)}&limit=1`, signal));
  const status = useStatus();
  const known = useRef<number | null>(null);
  const done = status?.dispatcher?.runs ?? null;
  const fresh = known.current !== null && done !== null && done > known.current ? done - known.current : 0;
  useEffect(() => {
    if (known.current === null && done !== null) known.current = done;
  }, [done]);
  useEffect(() => {
    const timer = window.setTimeout(() => search !== filter.search && setFilter({ ...filter, search }), 250);
    return () => window.clearTimeout(timer);
  }, [search]);
  const refresh = () => {
    known.current = done;
    setTurn(turn + 1);
  };
  const ids = [...ticked.keys()];
  const total = page?.total ?? first.value?.total ?? 0;
  const filtered = filter.search !== "" || filter.solver !== "" || filter.capture !== "";
  const bursts = (captures.value?.captures ?? []).filter((c) => c.sets > 0 && (c.kind === "burst" || c.kind === "live"));
  return (
    <div class="runs-page">
      <div class="bar">
        <h2>Runs</h2>
        <label>Search <input type="search" value={search} placeholder="part of a name" onInput={(e) => setSearch(e.currentTarget.value)} /></label>
        <label>Capture
          <select value={filter.capture} onChange={(e) => setFilter({ ...filter, capture: e.currentTarget.value })}>
            <option value="">all</option>
            {bursts.map((c) => <option key={c.capture} value={c.capture}>{c.capture}</option>)}
          </select>
        </label>
        <label>Solver
          <select value={filter.solver} onChange={(e) => setFilter({ ...filter, solver: e.currentTarget.value })}>
            <option value="">all</option>
            {(page?.solvers ?? first.value?.solvers ?? []).map((name) => <option key={name}>{name}</option>)}
          </select>
        </label>
        <span class="dim" role="status">{count(total)} {filtered ? "found" : "in all"}</span>
        {fresh > 0 && <button type="button" class="quiet" onClick={refresh}>↻ {count(fresh)} new</button>}
        <span class="grow" />
        {filter.capture && <a class="button" href={`#/film/${encodeURIComponent(filter.capture)}`}>▶ Film</a>}
        <a class="button" aria-disabled={ids.length !== 2} href={ids.length === 2 ? `#/compare/${ids.map(encodeURIComponent).join("/")}` : undefined} title="Tick two runs">Compare</a>
        <button type="button" disabled={ids.length === 0} onClick={() => setReprocessing(true)} title="Tick runs">Reprocess {ids.length > 0 ? count(ids.length) : ""} …</button>
        {ids.length > 0 && <button type="button" class="quiet" onClick={() => setTicked(new Map())}>Untick</button>}
      </div>
      {first.error && <Problem text={first.error} again={first.again} />}
      {first.value && first.value.total === 0 && !first.error
        ? <Empty title={filtered ? "No run fits." : "No runs yet."}>{filtered ? "Take a part of the search away." : "A burst with a rig makes one volume a pulse: start flamefield serve --rig rig.yaml, then Burst on the live page."}</Empty>
        : <RunTable filter={filter} setFilter={setFilter} turn={turn} ticked={ticked} setTicked={setTicked} onPage={setPage} />}
      {reprocessing && <Reprocess runs={[...ticked.values()]} onClose={() => setReprocessing(false)} onDone={refresh} />}
    </div>
  );
}
