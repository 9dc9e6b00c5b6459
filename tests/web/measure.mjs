// How far the live page is behind, with a capture running on the same machine and software rendering:
//   tests/web/run build/release/bin build/release/tests/web measure.mjs        PULSES=150 for a longer burst
// Prints milliseconds behind the set (since its trigger pulse) and behind readiness (since the set was complete, or
// the volume was committed), the rate of the 3D view, first load, and whether the capture was complete.
import { launchBrowser, openPage, Server } from "./fixture.mjs";

const pulses = Number(process.env.PULSES ?? 100);
const share = (values, p) => [...values].sort((a, b) => a - b)[Math.min(values.length - 1, Math.floor(p * values.length))];
const ms = (value) => (value === undefined ? "–" : value.toFixed(0));

const server = await Server.start();
const browser = await launchBrowser();
const page = await openPage(browser);
let bytes = 0;
const client = await page.context().newCDPSession(page);
await client.send("Network.enable");
client.on("Network.loadingFinished", (event) => { bytes += event.encodedDataLength; });
const begin = Date.now();
await page.goto(`${server.url}#/live`);
await page.locator(".tile").first().waitFor();
const first_ms = Date.now() - begin;
const early = bytes;
await page.locator(".volume-canvas canvas").waitFor();
await page.waitForTimeout(2000);
console.log(`first load ${first_ms} ms until the counters, ${(early / 1000).toFixed(0)} kB; with the 3D view ${(bytes / 1000).toFixed(0)} kB over HTTP`);

await page.evaluate(() => {
  window.samples = [];
  window.frames = 0;
  window.addEventListener("flamefield:shown", (event) => window.samples.push(event.detail));
  window.addEventListener("flamefield:drawn", () => { ++window.frames; });
});
const started = await server.post("capture", { kind: "burst", pulses });
const clock = Date.now();
const framesBefore = await page.evaluate(() => window.frames);
await server.until("the burst is over", async () => (await server.get("status")).array?.phase === "idle", 600_000);
const seconds = (Date.now() - clock) / 1000;
const frames = (await page.evaluate(() => window.frames)) - framesBefore;
await server.idle(600_000);
const samples = await page.evaluate(() => window.samples);
console.log("what         shown   behind set p50/p95 ms   behind readiness p50/p95 ms");
for (const what of ["thumbnails", "frame", "counters", "slices", "view"]) {
  const of = samples.filter((s) => s.what === what);
  const set = of.map((s) => s.behind_set_ms);
  const ready = of.map((s) => s.behind_ready_ms);
  console.log(`${what.padEnd(12)} ${String(of.length).padStart(5)}   ${ms(share(set, 0.5))} / ${ms(share(set, 0.95))}   ${ms(share(ready, 0.5))} / ${ms(share(ready, 0.95))}`);
}
console.log(`3D view ${(frames / seconds).toFixed(1)} frames/s while capturing (${seconds.toFixed(1)} s)`);
const receipt = await server.get(`captures/${started.capture}/receipt`);
const lost = receipt.cameras.filter((camera) => camera.frames !== pulses);
console.log(`capture: ${receipt.pulses} pulses = ${receipt.sets} sets = ${receipt.volumes} volumes, cameras with losses: ${lost.length}`);
await browser.close();
await server.end();
