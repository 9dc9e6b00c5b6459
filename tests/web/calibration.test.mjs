// A guided calibration session in the browser, from the first pose to the accepted rig and its history.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { after, before, test } from "node:test";
import { launchBrowser, openPage, saveShot, Server } from "./fixture.mjs";

const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
let server;
let browser;
before(async () => {
  server = await Server.start({ copy: false, rig: false });
  browser = await launchBrowser();
}, { timeout: 240_000 });
after(async () => {
  await browser?.close();
  await server?.end();
});

// What goes wrong in the page fails the test, at whatever moment.
async function withPage(act, options = {}) {
  const page = await openPage(browser, options);
  try {
    await page.goto(`${server.url}#/calibration`);
    await act(page);
    assert.deepEqual(page.problems, [], "errors in the browser's console");
  } catch (error) {
    saveShot("calibration-failed.png", await page.screenshot().catch(() => Buffer.alloc(0)));
    throw error;
  } finally {
    await page.context().close();
  }
}

async function accessible(page, where) {
  await page.evaluate(axe);
  const found = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
  const serious = found.violations.filter((v) => v.impact === "serious" || v.impact === "critical");
  assert.deepEqual(serious.map((v) => `${v.id}: ${v.nodes.map((n) => n.html.slice(0, 120)).join(" | ")}`), [], `serious violations: ${where}`);
}

async function lookBothWays(page, name) {
  for (const [theme, other] of [["dark", "light"], ["light", "dark"]]) {
    await page.waitForTimeout(300);
    await accessible(page, `${name}, ${theme}`);
    saveShot(`calibration-${name}-${theme}.png`, await page.screenshot({ fullPage: true }));
    await page.getByRole("button", { name: `Change to the ${other} theme` }).click();
  }
}

async function hold(page, { poses, name }) {
  await page.getByLabel("Poses wanted").fill(String(poses));
  await page.getByRole("button", { name: "Start a session" }).click();
  // Cameras that hang loose would be refused.
  await server.until("enough poses that tie all cameras", async () => {
    const state = await server.get("calibration");
    return state.poses >= poses && state.links_missing.length === 0;
  }, 180_000);
  await page.locator(".overlaid .corners[d^=M]").first().waitFor({ state: "attached", timeout: 60_000 });
  if (name) {
    await page.getByRole("button", { name: /cam07/ }).click();
    await page.locator(".seen .frame canvas").waitFor();
    await lookBothWays(page, `${name}-session`);
    await page.getByRole("button", { name: "Close" }).click();
  }
  await page.getByRole("button", { name: "Solve", exact: true }).click();
  await page.getByRole("button", { name: "Accept …" }).and(page.locator(":enabled")).waitFor({ timeout: 120_000 }).catch(async (error) => {
    const { state, poses, verdict, message, error: problem } = await server.get("calibration");
    throw new Error(`${error.message}\nthe session: ${JSON.stringify({ state, poses, verdict, message, problem })}`);
  });
}

async function accept(page, note) {
  await page.getByRole("button", { name: "Accept …" }).click();
  const dialog = page.getByRole("dialog");
  assert.ok(await dialog.getByRole("button", { name: "Accept", exact: true }).isDisabled(), "nobody accepts without a name");
  await dialog.getByLabel("Your name").fill("browser test");
  await dialog.getByLabel("Note").fill(note);
  await dialog.getByRole("button", { name: "Accept", exact: true }).click();
  await page.getByText(/✓ Calibration \d+ accepted/).waitFor({ timeout: 60_000 });
}

test("before the first session the page says what to do", { timeout: 60_000 }, async () => {
  await withPage(async (page) => {
    await page.getByRole("button", { name: "Start a session" }).waitFor();
    await page.getByText("No calibration is in use yet.").waitFor();
    await lookBothWays(page, "empty");
  });
});

test("calibration session to accepted rig", { timeout: 600_000 }, async () => {
  await withPage(async (page) => {
    await hold(page, { poses: 10, name: "first" });
    await page.getByRole("region", { name: "Ring found" }).getByRole("img").waitFor();
    await lookBothWays(page, "first-solved");
    const state = await server.get("calibration");
    assert.equal(state.state, "solved");
    assert.ok(["green", "amber"].includes(state.verdict), state.verdict);
    // The report opens with its own style.
    const [report] = await Promise.all([page.context().waitForEvent("page"), page.getByRole("link", { name: "Report" }).click()]);
    await report.getByRole("heading").first().waitFor();
    assert.notEqual(await report.evaluate(() => getComputedStyle(document.body).fontFamily), "", "the report's style applies");
    saveShot("calibration-report.png", await report.screenshot({ fullPage: true }));
    await report.close();
    await accept(page, "first light");
    assert.equal((await server.get("calibrations")).calibrations.length, 1);

    // From now on bursts are reconstructed with it.
    const rig = (await server.get("calibrations")).calibrations[0].rig_id;
    await server.post("capture", { kind: "burst", pulses: 1 });
    const run = await server.until("a volume", async () => (await server.get("runs?limit=1")).runs[0], 120_000);
    assert.equal(run.rig, rig);

    // The second one is compared with the first.
    await hold(page, { poses: 10 });
    await page.getByText(/since calibration 1/).first().waitFor();
    await accept(page, "nothing was touched");
    await page.getByRole("region", { name: "Accepted calibrations" }).getByText("nothing was touched").waitFor();
    await lookBothWays(page, "accepted");
    const ring = page.getByRole("application", { name: /The ring in space/ });
    await ring.focus();
    await page.keyboard.press("ArrowRight");
    await page.getByRole("button", { name: "from above" }).click();
    const history = (await server.get("calibrations")).calibrations;
    assert.deepEqual(history.map((c) => c.version), [1, 2]);
    assert.equal(history[1].predecessor, 1);
    assert.equal(history[1].accepted_by, "browser test");
  });
});

test("a session is discarded after a question, and the array is free again", { timeout: 120_000 }, async () => {
  await withPage(async (page) => {
    await page.getByRole("button", { name: "Start a session" }).click();
    await page.getByText(/cameras see the board/).waitFor();
    await page.getByRole("button", { name: "Discard …" }).click();
    await page.getByRole("dialog").getByRole("button", { name: "Cancel" }).click();
    assert.equal((await server.get("calibration")).state, "detecting");
    await page.getByRole("button", { name: "Discard …" }).click();
    await page.getByRole("dialog").getByRole("button", { name: "Discard" }).click();
    await page.getByRole("button", { name: "Start a session" }).waitFor({ timeout: 60_000 });
    await server.until("the array is free", async () => (await server.get("status")).array?.phase === "idle", 10_000);
  });
});
