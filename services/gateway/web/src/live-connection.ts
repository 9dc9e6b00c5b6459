// One WebSocket for the whole page. Topics are wanted by components, counted, and asked for together. A connection
// that is silent for too long is lost, whether the browser has noticed or not; it is tried again until it heals.
import { type Message, type Status, unframed } from "./api";

export type Link = { state: "connecting" | "open" | "lost"; since: number };
type Listener<T> = (value: T) => void;

const kSilent_ms = 2500;
const kWatch_ms = 500;
const kRetry_ms = [300, 600, 1000, 2000, 3000];

class LiveConnection {
  private socket: WebSocket | null = null;
  private wanted = new Map<string, Set<Listener<Message<never>>>>();
  private statusListeners = new Set<Listener<Status>>();
  private linkListeners = new Set<Listener<Link>>();
  private heard = 0;
  private watched = Date.now();
  private attempt = 0;
  private retryTimer = 0;
  private offsets: number[] = [];
  link: Link = { state: "connecting", since: Date.now() };
  status: Status | null = null;

  start(): void {
    this.open();
    window.setInterval(() => this.watch(), kWatch_ms);
  }

  // The server's clock minus ours, from the quickest of the last messages.
  get clockOffset_ms(): number {
    return this.offsets.length ? Math.max(...this.offsets) : 0;
  }
  serverNow_ms(): number {
    return Date.now() + this.clockOffset_ms;
  }

  onStatus(listener: Listener<Status>): () => void {
    this.statusListeners.add(listener);
    if (this.status) listener(this.status);
    return () => this.statusListeners.delete(listener);
  }
  onLink(listener: Listener<Link>): () => void {
    this.linkListeners.add(listener);
    listener(this.link);
    return () => this.linkListeners.delete(listener);
  }
  on<Head>(topic: string, listener: Listener<Message<Head>>): () => void {
    const listeners = this.wanted.get(topic) ?? new Set();
    listeners.add(listener as Listener<Message<never>>);
    this.wanted.set(topic, listeners);
    this.tell();
    return () => {
      listeners.delete(listener as Listener<Message<never>>);
      if (listeners.size === 0) this.wanted.delete(topic);
      this.tell();
    };
  }

  private tell(): void {
    if (this.socket?.readyState !== WebSocket.OPEN) return;
    this.socket.send(["want", "status", ...this.wanted.keys()].join(" "));
  }

  private open(): void {
    window.clearTimeout(this.retryTimer);
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/api/v1/live`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.heard = Date.now();
    socket.onopen = () => this.tell();
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (socket === this.socket) this.take(event.data);
    };
    socket.onclose = () => {
      if (socket === this.socket) this.lose();
    };
  }

  private take(data: string | ArrayBuffer): void {
    this.heard = Date.now();
    if (this.link.state !== "open") this.setLink("open");
    this.attempt = 0;
    if (typeof data === "string") {
      this.status = JSON.parse(data) as Status;
      this.offsets.push(this.status.time_ns / 1e6 - Date.now());
      if (this.offsets.length > 30) this.offsets.shift();
      for (const listener of this.statusListeners) listener(this.status);
      return;
    }
    try {
      const message = unframed<{ topic: string }>(data);
      for (const listener of this.wanted.get(message.head.topic) ?? []) listener(message as Message<never>);
    } finally {
      this.socket?.send("got");
    }
  }

  private watch(): void {
    const now = Date.now();
    // Were we asleep or busy ourselves, messages may wait to be read: then nobody is lost yet.
    if (now - this.watched > 2 * kWatch_ms) this.heard = Math.max(this.heard, now - kSilent_ms + 2 * kWatch_ms);
    this.watched = now;
    if (this.socket && now - this.heard > kSilent_ms) this.lose();
  }

  private lose(): void {
    const socket = this.socket;
    this.socket = null;
    socket?.close();
    if (this.link.state !== "lost") this.setLink("lost");
    const wait = kRetry_ms[Math.min(this.attempt++, kRetry_ms.length - 1)];
    this.retryTimer = window.setTimeout(() => this.open(), wait);
  }

  private setLink(state: Link["state"]): void {
    this.link = { state, since: Date.now() };
    for (const listener of this.linkListeners) listener(this.link);
  }
}

export const live = new LiveConnection();

// For measurements: what was drawn, of which moment. tests/web listens.
export function shown(what: string, set_time_ns: number, ready_time_ns = set_time_ns): void {
  const now_ms = live.serverNow_ms();
  const detail = { what, behind_set_ms: now_ms - set_time_ns / 1e6, behind_ready_ms: now_ms - ready_time_ns / 1e6 };
  window.dispatchEvent(new CustomEvent("flamefield:shown", { detail }));
}
