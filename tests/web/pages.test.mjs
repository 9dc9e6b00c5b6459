// Every page against a running server with the simulated array, as a person would use it.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { after, before, test } from "node:test";
import { launchBrowser, openPage, saveShot, Server } from "./fixture.mjs";

const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
let server;
let browser;
before(async () => {
  server = await Server.start();
  browser = await launchBrowser();
}, { timeout: 240_000 });
after(async () => {
  await browser?.close();
  await server?.end();
});

const at = (place) => `${server.url}#/${place}`;

async function withPage(place, act, { expected, ...options } = {}) {
  const page = await openPage(browser, options);
  try {
    await page.goto(at(place));
    await act(page);
    const serious = page.problems.filter((text) => !expected?.test(text));
    assert.deepEqual(serious, [], "errors in the browser's console");
  } catch (error) {
    saveShot("failed.png", await page.screenshot().catch(() => Buffer.alloc(0)));
    throw error;
  } finally {
    await page.context().close();
  }
}

async function burst(page, pulses) {
  await page.getByLabel("of pulses").fill(String(pulses));
  await page.getByRole("button", { name: "Burst" }).click();
}

// axe runs inside of the page's own policy: it is brought in by the test, not by the page.
async function accessible(page, where) {
  await page.evaluate(axe);
  const found = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
  const serious = found.violations.filter((v) => v.impact === "serious" || v.impact === "critical");
  assert.deepEqual(serious.map((v) => `${v.id}: ${v.nodes.map((n) => n.html.slice(0, 120)).join(" | ")}`), [], `serious violations on ${where}`);
}

async function runIds(query = "limit=100") {
  return (await server.get(`runs?${query}`)).runs;
}

test("a burst from the live page ends as volumes in 3D", { timeout: 240_000 }, async () => {
  await withPage("live", async (page) => {
    const before = (await server.get("runs")).total;
    await page.getByRole("button", { name: "Burst" }).waitFor();
    await page.evaluate(() => {
      window.drawn = [];
      window.addEventListener("flamefield:shown", (event) => window.drawn.push(event.detail.what));
    });
    await burst(page, 3);
    await page.getByText("Last:").waitFor({ timeout: 60_000 });
    await server.until("three volumes", async () => (await server.get("runs")).total >= before + 3, 120_000);
    for (const what of ["thumbnails", "counters", "frame", "slices", "view"])
      await page.waitForFunction((name) => window.drawn.includes(name), what, { timeout: 60_000 });
    const status = await server.idle();
    assert.equal(status.counters.pulses, 3);
    assert.equal(status.counters.lost_frames, 0);
    await page.waitForFunction(() => document.querySelectorAll(".tile.good").length >= 3, null, { timeout: 10_000 });
    // The volume is not a black rectangle.
    const lit = await page.evaluate(async () => {
      const canvas = document.querySelector(".volume-canvas canvas");
      const copy = document.createElement("canvas");
      copy.width = canvas.width; copy.height = canvas.height;
      return new Promise((resolve) => {
        const look = () => requestAnimationFrame(() => {
          copy.getContext("2d").drawImage(canvas, 0, 0);
          const pixels = copy.getContext("2d").getImageData(0, 0, copy.width, copy.height).data;
          let bright = 0;
          for (let i = 0; i < pixels.length; i += 4) if (pixels[i] > 120) ++bright;
          if (bright > 50) resolve(bright); else window.setTimeout(look, 100);
        });
        look();
        window.setTimeout(() => resolve(0), 15_000);
      });
    });
    assert.ok(lit > 50, "the 3D view shows a flame");
  });
});

test("the cross names the grey level under it", { timeout: 60_000 }, async () => {
  await withPage("live", async (page) => {
    const frame = page.locator(".frame");
    await page.getByText("Point at a pixel.").waitFor();
    await frame.focus();
    await page.keyboard.press("ArrowRight");
    await page.locator(".readout", { hasText: /x \d+ px, y \d+ px: \d+ of 255/ }).waitFor();
  });
});

test("what costs data is asked twice", { timeout: 120_000 }, async () => {
  await withPage("live", async (page) => {
    await page.getByRole("button", { name: "Burst" }).waitFor();
    await burst(page, 200);
    await page.getByText(/: [1-9]\d* of 200 pulses/).waitFor({ timeout: 30_000 });
    await page.getByRole("button", { name: "■ Stop" }).click();
    await page.getByRole("heading", { name: "Stop this burst?" }).waitFor();
    await page.getByRole("button", { name: "Cancel" }).click();
    assert.equal((await server.get("status")).array.phase, "armed", "cancelled: the burst goes on");
    await page.getByRole("button", { name: "■ Stop" }).click();
    await page.getByRole("dialog").getByRole("button", { name: "Stop" }).click();
    await page.getByText("Last:").waitFor({ timeout: 60_000 });
    await page.getByRole("button", { name: "Dark", exact: true }).click();
    await page.getByRole("heading", { name: /dark frame sets/ }).waitFor();
    await page.keyboard.press("Escape");
    assert.equal((await server.get("status")).array.phase, "idle");
  });
  await server.idle();
});

test("from the table of runs to a comparison with a difference volume", { timeout: 120_000 }, async () => {
  await withPage("runs", async (page) => {
    const boxes = page.getByRole("checkbox", { name: /^tick/ });
    await boxes.first().waitFor();
    await boxes.nth(0).check();
    await boxes.nth(1).check();
    await page.getByRole("link", { name: "Compare" }).click();
    await page.getByText(/Pearson [0-9.]+ · RMSE/).waitFor({ timeout: 30_000 });
    await page.getByRole("table").getByText("Residual (1)").waitFor();
  });
});

test("the table sorts, filters and searches on the server", { timeout: 60_000 }, async () => {
  await withPage("runs", async (page) => {
    await page.getByRole("checkbox", { name: /^tick/ }).first().waitFor();
    await page.getByRole("button", { name: "Residual (1)" }).click();
    await page.locator('[aria-sort="descending"]', { hasText: "Residual" }).waitFor();
    const residuals = (await runIds("sort=residual")).map((r) => r.residual);
    assert.deepEqual(residuals, [...residuals].sort((a, b) => b - a));
    await page.getByLabel("Search").fill("no such run");
    await page.getByText("No run fits.").waitFor();
    await page.getByLabel("Search").fill("");
    await page.getByRole("checkbox", { name: /^tick/ }).first().waitFor();
  });
});

test("a run's page shows provenance, receipt, images, slices and curves", { timeout: 60_000 }, async () => {
  const [run] = await runIds("limit=1");
  await withPage(`runs/${encodeURIComponent(run.id)}`, async (page) => {
    await page.getByText("✓ Balanced:").waitFor();
    await page.getByRole("img", { name: /^Residual of each view/ }).locator("canvas").waitFor();
    await page.getByRole("img", { name: /^slice normal to z/ }).waitFor();
    await page.getByText("Fingerprint").waitFor();
    await page.locator(".thumbnail").first().click();
    await page.getByText("Point at a pixel.").waitFor();
    const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("link", { name: /Volume \(/ }).click()]);
    assert.match(download.suggestedFilename(), /\.vtkhdf$/);
  });
});

test("runs are reprocessed with other settings and the result is shown", { timeout: 240_000 }, async () => {
  await withPage("runs", async (page) => {
    await page.getByRole("checkbox", { name: /^tick/ }).first().check();
    await page.getByRole("button", { name: /Reprocess 1/ }).click();
    await page.getByRole("dialog").getByRole("combobox", { name: /^Solver/ }).selectOption("sirt");
    const iterations = page.locator('[id="setting-sirt.max_iterations"]');
    await iterations.fill("-5");
    await page.getByText(/✗ must be/).first().waitFor();
    await iterations.fill(String(3 + (process.pid % 40)));
    await page.getByRole("button", { name: "Estimate" }).click();
    await page.getByText(/1 volumes on/).waitFor();
    await page.getByRole("dialog").getByRole("button", { name: "Reprocess", exact: true }).click();
    await page.getByRole("progressbar").waitFor();
    await page.getByRole("link", { name: "Show the result" }).click({ timeout: 120_000 });
    await page.getByText(/sirt, \d+ iterations/).waitFor();
  });
});

test("a burst plays as a film", { timeout: 60_000 }, async () => {
  const captures = (await server.get("captures")).captures.filter((c) => c.kind === "burst" && c.sets >= 3);
  await withPage(`film/${encodeURIComponent(captures.at(-1).capture)}`, async (page) => {
    await page.getByText(/^\d+ volumes/).waitFor();
    const pulse = page.locator(".player .number");
    const first = await pulse.textContent();
    await page.waitForFunction((text) => document.querySelector(".player .number").textContent !== text, first, { timeout: 10_000 });
  });
});

test("a recipe is edited, kept, compared and deleted", { timeout: 60_000 }, async () => {
  await withPage("recipes", async (page) => {
    await page.getByLabel("Solver").first().selectOption("mlem");
    await page.locator('[id="setting-mlem.max_iterations"]').fill("12");
    await page.getByLabel("Save as").fill("browser-test");
    await page.getByRole("button", { name: "Save", exact: true }).click();
    await page.getByText("✓ Saved as browser-test.").waitFor();
    const kept = (await server.get("recipes")).recipes.find((r) => r.name === "browser-test");
    assert.equal(kept.solver, "mlem");
    assert.equal(kept.settings["mlem.max_iterations"], 12);
    await page.getByLabel("Compare with").selectOption("ctc");
    await page.getByRole("region", { name: "Differences" }).getByText("solver").waitFor();
    await page.getByRole("button", { name: "Delete …" }).click();
    await page.getByRole("dialog").getByRole("button", { name: "Delete" }).click();
    await server.until("deleted", async () => !(await server.get("recipes")).recipes.some((r) => r.name === "browser-test"));
  });
});

test("a connection that is cut is seen at once and heals", { timeout: 120_000 }, async () => {
  await withPage("live", async (page) => {
    await page.getByRole("button", { name: "Burst" }).waitFor();
    const cut = Date.now();
    await server.stop("SIGKILL");
    await page.getByRole("alert").filter({ hasText: "No connection" }).waitFor({ timeout: 4000 });
    assert.ok(Date.now() - cut < 4000);
    saveShot("live-lost.png", await page.screenshot());
    await server.launch(server.port);
    await page.getByRole("alert").filter({ hasText: "No connection" }).waitFor({ state: "detached", timeout: 30_000 });
    await burst(page, 1);  // and it may steer again
    await page.getByText("Last:").waitFor({ timeout: 60_000 });
  }, { expected: /ERR_CONNECTION_REFUSED|WebSocket|Failed to load resource|reset/ });
  await server.idle();
});

const pages = [
  ["live", (page) => page.locator(".thumbnail canvas").first().waitFor()],
  ["runs", (page) => page.getByRole("checkbox", { name: /^tick/ }).first().waitFor()],
  ["run", (page) => page.getByText("✓ Balanced:").waitFor()],
  ["compare", (page) => page.getByText(/Pearson/).waitFor()],
  ["film", (page) => page.getByText(/^\d+ volumes/).waitFor()],
  ["recipes", (page) => page.getByText("Defaults").waitFor()],
  ["calibration", (page) => page.getByRole("heading", { name: "Ring" }).waitFor()],
];
for (const theme of ["dark", "light"]) {
  test(`no page has a serious accessibility violation, ${theme}; pictures of each are kept`, { timeout: 240_000 }, async () => {
    await server.post("capture", { kind: "burst", pulses: 2 });
    await server.idle();
    const runs = await runIds("limit=2");
    const burstName = runs[0].capture;
    const places = { run: `runs/${encodeURIComponent(runs[0].id)}`, compare: `compare/${runs.map((r) => encodeURIComponent(r.id)).join("/")}`, film: `film/${encodeURIComponent(burstName)}` };
    for (const [name, ready] of pages) {
      await withPage(places[name] ?? name, async (page) => {
        await ready(page);
        await page.waitForTimeout(1500);  // the 3D view is drawn when it can
        await accessible(page, `${name}, ${theme}`);
        saveShot(`${name}-${theme}-1366.png`, await page.screenshot({ fullPage: name !== "runs" }));
        await page.setViewportSize({ width: 3840, height: 2160 });
        await page.waitForTimeout(800);
        saveShot(`${name}-${theme}-4k.png`, await page.screenshot());
      }, { colorScheme: theme });
    }
    await withPage("runs", async (page) => {
      await page.getByRole("checkbox", { name: /^tick/ }).first().check();
      await page.getByRole("button", { name: /Reprocess 1/ }).click();
      await page.getByRole("dialog").getByRole("combobox", { name: /^Solver/ }).waitFor();
      await accessible(page, `reprocess, ${theme}`);
      saveShot(`reprocess-${theme}-1366.png`, await page.screenshot());
    }, { colorScheme: theme });
  });
}
