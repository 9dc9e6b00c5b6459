import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { localTime, utcTitle } from "../format";

export function Time({ utc }: { utc: string }) {
  return <time dateTime={utc} title={utcTitle(utc)}>{localTime(utc)}</time>;
}

export function Empty({ title, children }: { title: string; children?: ComponentChildren }) {
  return <div class="empty"><strong>{title}</strong>{children && <p>{children}</p>}</div>;
}

export function Problem({ text, again }: { text: string; again?: () => void }) {
  return (
    <div class="problem" role="alert">
      <span aria-hidden="true">⚠ </span>{text}
      {again && <button type="button" onClick={again}>Try again</button>}
    </div>
  );
}

export function Loading({ what }: { what: string }) {
  return <div class="empty" role="status">Loading {what} …</div>;
}

export function Card({ title, aside, class: name = "", children }: { title: string; aside?: ComponentChildren; class?: string; children: ComponentChildren }) {
  return (
    <section class={`card ${name}`} aria-label={title}>
      <header class="card-head"><h2>{title}</h2>{aside}</header>
      {children}
    </section>
  );
}

export type Mark = "good" | "fair" | "poor" | "";
const kMarks = { good: "✓", fair: "◔", poor: "✗", "": "" };

// A number that matters. The mark says in shape what the colour says.
export function Tile({ value, name, mark = "", title }: { value: string; name: string; mark?: Mark; title?: string }) {
  return (
    <div class={`tile ${mark}`} title={title}>
      <b>{value}{mark && <i aria-label={{ good: "all right", fair: "waiting", poor: "problem" }[mark]} role="img">{kMarks[mark]}</i>}</b>
      <span>{name}</span>
    </div>
  );
}

export function Dialog({ title, onClose, children }: { title: string; onClose: () => void; children: ComponentChildren }) {
  const ref = useRef<HTMLDialogElement>(null);
  useEffect(() => {
    const dialog = ref.current;
    dialog?.showModal();
    return () => dialog?.close();
  }, []);
  return (
    <dialog ref={ref} onClose={onClose} aria-labelledby="dialog-title">
      <h2 id="dialog-title">{title}</h2>
      {children}
    </dialog>
  );
}

export function Confirm({ title, act, onAct, onClose, children }: { title: string; act: string; onAct: () => void; onClose: () => void; children: ComponentChildren }) {
  return (
    <Dialog title={title} onClose={onClose}>
      <p>{children}</p>
      <div class="buttons">
        <button type="button" class="danger" onClick={() => { onAct(); onClose(); }}>{act}</button>
        <button type="button" autofocus onClick={onClose}>Cancel</button>
      </div>
    </Dialog>
  );
}

export function Facts({ rows }: { rows: [string, ComponentChildren][] }) {
  return (
    <dl class="facts">
      {rows.map(([name, value]) => <div key={name}><dt>{name}</dt><dd>{value}</dd></div>)}
    </dl>
  );
}
