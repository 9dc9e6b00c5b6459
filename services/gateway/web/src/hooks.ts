import { useEffect, useRef, useState } from "preact/hooks";
import type { Message, Status } from "./api";
import { live, type Link } from "./live-connection";

export function useStatus(): Status | null {
  const [status, setStatus] = useState<Status | null>(live.status);
  useEffect(() => live.onStatus(setStatus), []);
  return status;
}

export function useLink(): Link {
  const [link, setLink] = useState<Link>(live.link);
  useEffect(() => live.onLink(setLink), []);
  return link;
}

// The newest message of a topic goes to `take`, which may change from one rendering to the next.
export function useTopic<Head>(topic: string | null, take: (message: Message<Head>) => void): void {
  const newest = useRef(take);
  newest.current = take;
  useEffect(() => (topic ? live.on<Head>(topic, (message) => newest.current(message)) : undefined), [topic]);
}

export type Loaded<T> = { value: T | null; error: string | null; loading: boolean; again: () => void };

// What `load` gives, again whenever `key` changes; an answer that comes too late is dropped.
export function useLoaded<T>(key: string, load: (signal: AbortSignal) => Promise<T>): Loaded<T> {
  const [turn, setTurn] = useState(0);
  const [state, setState] = useState<{ value: T | null; error: string | null; loading: boolean }>({ value: null, error: null, loading: true });
  useEffect(() => {
    const stop = new AbortController();
    setState((old) => ({ ...old, error: null, loading: true }));
    load(stop.signal).then(
      (value) => stop.signal.aborted || setState({ value, error: null, loading: false }),
      (problem: Error) => stop.signal.aborted || setState({ value: null, error: problem.message, loading: false }),
    );
    return () => stop.abort();
  }, [key, turn]);
  return { ...state, again: () => setTurn((t) => t + 1) };
}

export function useInterval(period_ms: number, act: () => void): void {
  const newest = useRef(act);
  newest.current = act;
  useEffect(() => {
    const timer = window.setInterval(() => newest.current(), period_ms);
    return () => window.clearInterval(timer);
  }, [period_ms]);
}

// Size of an element's content box in CSS pixels.
export function useSize<E extends HTMLElement>(): [{ current: E | null }, { width: number; height: number }] {
  const ref = useRef<E>(null);
  const [size, setSize] = useState({ width: 0, height: 0 });
  useEffect(() => {
    if (!ref.current) return undefined;
    const observer = new ResizeObserver(([entry]) => setSize({ width: entry.contentRect.width, height: entry.contentRect.height }));
    observer.observe(ref.current);
    return () => observer.disconnect();
  }, []);
  return [ref, size];
}
