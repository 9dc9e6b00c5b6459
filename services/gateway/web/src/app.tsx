import { useEffect, useState } from "preact/hooks";
import { CalibrationPage } from "./calibration/calibration-page";
import { localTime, utcTitle } from "./format";
import { useInterval, useLink, useStatus } from "./hooks";
import { LivePage } from "./live/live-page";
import { live } from "./live-connection";
import { RecipesPage } from "./recipes/recipes-page";
import { ComparePage } from "./runs/compare-page";
import { FilmPage } from "./runs/film-page";
import { RunPage } from "./runs/run-page";
import { RunsPage } from "./runs/runs-page";

const kPages = [
  ["live", "Live"],
  ["runs", "Runs"],
  ["recipes", "Recipes"],
  ["calibration", "Calibration"],
] as const;

function usePlace(): string[] {
  const read = () => location.hash.replace(/^#\/?/, "").split("/").filter(Boolean).map(decodeURIComponent);
  const [place, setPlace] = useState(read);
  useEffect(() => {
    const moved = () => setPlace(read());
    window.addEventListener("hashchange", moved);
    return () => window.removeEventListener("hashchange", moved);
  }, []);
  return place.length ? place : ["live"];
}

type Theme = "dark" | "light";
function useTheme(): [Theme, () => void] {
  const system: Theme = window.matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark";
  const [theme, setTheme] = useState<Theme>((localStorage.getItem("theme") as Theme | null) ?? system);
  document.documentElement.dataset.theme = theme;
  return [
    theme,
    () => {
      const other = theme === "dark" ? "light" : "dark";
      localStorage.setItem("theme", other);
      setTheme(other);
    },
  ];
}

function Clock() {
  const [now, setNow] = useState(() => new Date().toISOString());
  useInterval(1000, () => setNow(new Date(live.serverNow_ms()).toISOString()));
  return <time class="dim clock" dateTime={now} title={utcTitle(now.slice(0, 19))}>{localTime(now)}</time>;
}

function LinkBanner() {
  const link = useLink();
  const [, tick] = useState(0);
  useInterval(1000, () => tick((n) => n + 1));
  if (link.state !== "lost") return null;
  const since = new Date(link.since).toISOString();
  return (
    <div class="banner" role="alert">
      <span aria-hidden="true">⚠ </span>No connection to flamefield since <time title={utcTitle(since)}>{localTime(since)}</time> ({Math.round((Date.now() - link.since) / 1000)} s).
      What is shown is old. Trying again.
    </div>
  );
}

function State() {
  const link = useLink();
  const status = useStatus();
  if (link.state !== "open" || !status) return <span class={`pill ${link.state === "lost" ? "poor" : ""}`} role="status">{link.state === "lost" ? "✗ no connection" : "connecting …"}</span>;
  if (!status.array) return <span class="pill fair" role="status">◔ no camera array</span>;
  const lost = status.array.cameras.filter((c) => !c.connected).length;
  const all = status.array.cameras.length;
  const busy = status.array.phase !== "idle";
  const cameras = lost ? `${all - lost} of ${all} cameras` : `${all} cameras`;
  return <span class={`pill ${lost ? "poor" : busy ? "good" : ""}`} role="status">{lost ? "✗ " : busy ? "● " : "○ "}{busy ? `${status.array.phase} · ${status.array.kind}` : "idle"} · {cameras}</span>;
}

export function App() {
  const place = usePlace();
  const [theme, otherTheme] = useTheme();
  const link = useLink();
  const [name, id, other] = place;
  useEffect(() => {
    document.title = `${kPages.find(([key]) => key === name)?.[1] ?? "Run"} – flamefield`;
    document.querySelector("main")?.scrollTo?.(0, 0);
  }, [place.join("/")]);
  const page =
    name === "runs" && id ? <RunPage key={id} id={id} />
    : name === "runs" ? <RunsPage />
    : name === "compare" ? <ComparePage key={`${id} ${other}`} left={id ?? ""} right={other ?? ""} />
    : name === "film" ? <FilmPage key={id} capture={id ?? ""} />
    : name === "recipes" ? <RecipesPage />
    : name === "calibration" ? <CalibrationPage />
    : <LivePage />;
  const current = ["compare", "film"].includes(name) ? "runs" : name;
  return (
    <>
      <a class="skip" href="#content" onClick={(event) => { event.preventDefault(); document.getElementById("content")?.focus(); }}>Skip to content</a>
      <header class="top">
        <h1><b>flame</b>field</h1>
        <nav aria-label="Pages">
          {kPages.map(([key, title]) => <a key={key} href={`#/${key}`} aria-current={key === current ? "page" : undefined}>{title}</a>)}
        </nav>
        <State />
        <span class="grow" />
        <Clock />
        <button type="button" class="quiet" onClick={otherTheme} aria-label={`Change to the ${theme === "dark" ? "light" : "dark"} theme`} title={`Change to the ${theme === "dark" ? "light" : "dark"} theme`}>{theme === "dark" ? "☀" : "☾"}</button>
      </header>
      <LinkBanner />
      <main id="content" tabIndex={-1} class={link.state === "lost" && name === "live" ? "stale" : ""}>{page}</main>
    </>
  );
}
