// What the tests share: an installation with a calibrated ring and a few runs, made once, and a server and a browser.
import { spawn, spawnSync } from "node:child_process";
import { cpSync, existsSync, mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium } from "playwright-core";

export const bin = process.env.FLAMEFIELD_BIN;
export const shots = process.env.FLAMEFIELD_SHOTS ?? join(tmpdir(), "flamefield-shots");
const made = process.env.FLAMEFIELD_WEB_FIXTURE ?? join(tmpdir(), "flamefield-web-fixture");
export const browserPath = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(existsSync);

// Loopback addresses of a camera array that nobody else has: one block of 256 for a process.
export function unusedAddress() {
  return `127.${60 + (process.pid % 120)}.${Math.floor(process.pid / 120) % 250}.2`;
}

// A calibrated simulated ring with four reconstructed pulses: what `flamefield demo` leaves.
export function installation() {
  const ready = join(made, "demo", "summary.json");
  if (!existsSync(ready)) {
    rmSync(made, { recursive: true, force: true });
    mkdirSync(made, { recursive: true });
    const done = spawnSync(join(bin, "flamefield"), ["demo", "--pulses", "4", "--poses", "12", "--out", join(made, "demo"), "--first-address", unusedAddress(), "--port", "0"], { encoding: "utf8" });
    if (done.status !== 0) throw new Error(`the demonstration failed:\n${done.stdout}\n${done.stderr}`);
  }
  return join(made, "demo");
}

// A server with its simulated array, on a copy of the installation.
export class Server {
  static async start({ copy = true, rig = true, more = [] } = {}) {
    const server = new Server();
    server.folder = join(tmpdir(), `flamefield-web-${process.pid}-${Math.random().toString(36).slice(2, 8)}`);
    mkdirSync(server.folder, { recursive: true });
    const demo = installation();
    if (copy) cpSync(join(demo, "data"), join(server.folder, "data"), { recursive: true, filter: (path) => !/\.sock$/.test(path) });
    server.arguments = ["serve", "--data", join(server.folder, "data"), "--first-address", unusedAddress(), ...(rig ? ["--rig", join(demo, "rig.yaml")] : []), ...more];
    await server.launch(0);
    return server;
  }
  async launch(port) {
    this.log = "";
    this.process = spawn(join(bin, "flamefield"), [...this.arguments, "--port", String(port)], { stdio: ["ignore", "pipe", "pipe"] });
    this.url = await new Promise((resolve, reject) => {
      const take = (text) => {
        this.log += text;
        const found = /live page (http:\S+)/.exec(this.log);
        if (found) resolve(found[1]);
      };
      this.process.stdout.on("data", take);
      this.process.stderr.on("data", take);
      this.process.on("exit", (code) => reject(new Error(`flamefield serve ended with ${code}:\n${this.log}`)));
    });
    this.port = Number(new URL(this.url).port);
    this.token = readFileSync(join(this.folder, "data", "run", "web-token"), "utf8").trim();
  }
  async get(path) {
    const answer = await fetch(`${this.url}api/v1/${path}`);
    if (!answer.ok) throw new Error(`${path}: ${answer.status} ${await answer.text()}`);
    return answer.json();
  }
  async post(path, body) {
    const answer = await fetch(`${this.url}api/v1/${path}`, { method: "POST", headers: { "Content-Type": "application/json", Authorization: `Bearer ${this.token}` }, body: JSON.stringify(body) });
    if (!answer.ok) throw new Error(`${path}: ${answer.status} ${await answer.text()}`);
    return answer.json();
  }
  // Kilobytes that the server's process holds in memory.
  residentKiB() {
    return Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${this.process.pid}/status`, "utf8"))[1]);
  }
  async until(what, condition, limit_ms = 60_000) {
    const end = Date.now() + limit_ms;
    for (;;) {
      const value = await condition();
      if (value) return value;
      if (Date.now() > end) throw new Error(`waited ${limit_ms} ms in vain: ${what}`);
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
  }
  // Waits until nothing is captured and nothing waits.
  idle(limit_ms = 120_000) {
    return this.until("all work done", async () => {
      const status = await this.get("status").catch(() => null);
      return status?.array?.phase === "idle" && status.counters.queued === 0 && status.counters.sets === status.counters.pulses && status;
    }, limit_ms);
  }
  async stop(signal = "SIGINT") {
    const ended = new Promise((resolve) => this.process.once("exit", resolve));
    this.process.removeAllListeners("exit");
    this.process.once("exit", () => {});
    const gone = new Promise((resolve) => this.process.once("close", resolve));
    this.process.kill(signal);
    await Promise.race([ended, gone]);
  }
  async end() {
    await this.stop();
    rmSync(this.folder, { recursive: true, force: true });
  }
}

export async function launchBrowser() {
  return chromium.launch({ executablePath: browserPath, args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"] });
}

// A page that remembers what went wrong in it.
export async function openPage(browser, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1366, height: 768 }, colorScheme: "dark", ...options });
  const page = await context.newPage();
  page.problems = [];
  page.on("pageerror", (error) => page.problems.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error" || /Content Security Policy/.test(message.text())) page.problems.push(message.text());
  });
  return page;
}

export function saveShot(name, bytes) {
  mkdirSync(shots, { recursive: true });
  writeFileSync(join(shots, name), bytes);
}
