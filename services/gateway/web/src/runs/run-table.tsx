import { useEffect, useRef, useState } from "preact/hooks";
import { get, type RunLine, type RunsPage } from "../api";
import { bytes, count, duration, significant } from "../format";
import { useSize } from "../hooks";
import { Time } from "../parts/basics";

const kRow_px = 44;
const kPage = 100;
const kAhead = 10; // rows drawn outside of the window

export interface Filter {
  search: string;
  solver: string;
  capture: string;
  sort: string;
  order: "asc" | "desc";
}
export const queryOf = (filter: Filter): string =>
  new URLSearchParams(Object.entries(filter).filter(([, value]) => value !== "") as [string, string][]).toString();

const kColumns: { key: string; title: string; sort?: string; number?: boolean }[] = [
  { key: "picture", title: "Brightest" },
  { key: "id", title: "Run" },
  { key: "capture", title: "Capture", sort: "capture" },
  { key: "pulse", title: "Pulse", number: true },
  { key: "solver", title: "Solver", sort: "solver" },
  { key: "residual", title: "Residual (1)", sort: "residual", number: true },
  { key: "duration", title: "Took", sort: "duration", number: true },
  { key: "size", title: "Size", sort: "volume_bytes", number: true },
  { key: "finished", title: "Finished", sort: "finished" },
];

function Row({ run, number, ticked, tick }: { run: RunLine | undefined; number: number; ticked: boolean; tick: (on: boolean) => void }) {
  if (!run) return <div role="row" aria-rowindex={number + 2} class="row waiting" style={{ top: `${number * kRow_px}px` }}><div role="cell">…</div></div>;
  return (
    <div role="row" aria-rowindex={number + 2} class={`row ${ticked ? "ticked" : ""}`} style={{ top: `${number * kRow_px}px` }}>
      <div role="cell"><input type="checkbox" aria-label={`tick ${run.id}`} checked={ticked} onChange={(e) => tick(e.currentTarget.checked)} /></div>
      <div role="cell"><img src={`/api/v1/runs/${encodeURIComponent(run.id)}/thumbnail.png`} alt="" width={36} height={36} loading="lazy" onError={(e) => { e.currentTarget.style.visibility = "hidden"; }} /></div>
      <div role="cell" title={run.id}><a href={`#/runs/${encodeURIComponent(run.id)}`}>{run.id}</a></div>
      <div role="cell" title={run.capture}>{run.capture}</div>
      <div role="cell" class="n">{run.inputs === 1 ? run.index + 1 : `mean of ${run.inputs}`}</div>
      <div role="cell">{run.solver}</div>
      <div role="cell" class="n">{significant(run.residual)}</div>
      <div role="cell" class="n">{duration(run.duration_s)}</div>
      <div role="cell" class="n">{bytes(run.volume_bytes)}</div>
      <div role="cell"><Time utc={run.finished} /></div>
    </div>
  );
}

// A hundred thousand rows: only those in the window exist, and only their pages are asked for.
export function RunTable({ filter, setFilter, turn, ticked, setTicked, onPage }: {
  filter: Filter;
  setFilter: (filter: Filter) => void;
  turn: number;
  ticked: Map<string, RunLine>;
  setTicked: (ticked: Map<string, RunLine>) => void;
  onPage: (page: RunsPage) => void;
}) {
  const pages = useRef(new Map<number, RunLine[]>());
  const asked = useRef(new Set<number>());
  const [total, setTotal] = useState(0);
  const [, redraw] = useState(0);
  const [scroll, setScroll] = useState(0);
  const [body, size] = useSize<HTMLDivElement>();
  const key = `${queryOf(filter)} ${turn}`;
  const current = useRef(key);
  useEffect(() => {
    current.current = key;
    pages.current = new Map();
    asked.current = new Set();
    redraw((n) => n + 1);
  }, [key]);
  const first = Math.max(0, Math.floor(scroll / kRow_px) - kAhead);
  const last = Math.min(total, Math.ceil((scroll + (size.height || 600)) / kRow_px) + kAhead);
  useEffect(() => {
    for (let page = Math.floor(first / kPage); page <= Math.floor(Math.max(last - 1, 0) / kPage); ++page) {
      if (asked.current.has(page)) continue;
      asked.current.add(page);
      const asker = current.current;
      get<RunsPage>(`runs?${queryOf(filter)}&offset=${page * kPage}&limit=${kPage}`).then(
        (answer) => {
          if (asker !== current.current) return;
          pages.current.set(page, answer.runs);
          // Far pages are forgotten again: memory stays small however far one scrolls.
          for (const known of pages.current.keys())
            if (Math.abs(known - page) > 20) { pages.current.delete(known); asked.current.delete(known); }
          setTotal(answer.total);
          onPage(answer);
          redraw((n) => n + 1);
        },
        () => asked.current.delete(page),
      );
    }
  });
  const lineAt = (row: number): RunLine | undefined => pages.current.get(Math.floor(row / kPage))?.[row % kPage];
  const sortBy = (sort: string) => setFilter({ ...filter, sort, order: filter.sort === sort && filter.order === "desc" ? "asc" : "desc" });
  const tick = (run: RunLine | undefined, on: boolean) => {
    if (!run) return;
    const next = new Map(ticked);
    if (on) next.set(run.id, run);
    else next.delete(run.id);
    setTicked(next);
  };
  const rows = [];
  for (let row = first; row < last; ++row) {
    const run = lineAt(row);
    rows.push(<Row key={row} run={run} number={row} ticked={!!run && ticked.has(run.id)} tick={(on) => tick(run, on)} />);
  }
  return (
    <div class="table" role="table" aria-label={`${count(total)} runs`} aria-rowcount={total + 1} ref={body} tabIndex={0} onScroll={(e) => setScroll(e.currentTarget.scrollTop)}>
      <div role="rowgroup" class="table-head">
        <div role="row" aria-rowindex={1} class="row head">
          <div role="columnheader"><span class="hidden">Ticked</span></div>
          {kColumns.map(({ key: name, title, sort, number }) => (
            <div role="columnheader" key={name} class={number ? "n" : ""} aria-sort={sort && filter.sort === sort ? (filter.order === "asc" ? "ascending" : "descending") : undefined}>
              {sort ? <button type="button" class="sort" onClick={() => sortBy(sort)}>{title}{filter.sort === sort && <span aria-hidden="true">{filter.order === "asc" ? " ▲" : " ▼"}</span>}</button> : title}
            </div>
          ))}
        </div>
      </div>
      <div class="tall" role="rowgroup" style={{ height: `${total * kRow_px}px` }}>{rows}</div>
    </div>
  );
}
