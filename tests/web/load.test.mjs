// What must not disturb a recording: many browsers, stuck ones, broken ones.
import assert from "node:assert/strict";
import { connect } from "node:net";
import { randomBytes } from "node:crypto";
import { after, before, test } from "node:test";
import { Server } from "./fixture.mjs";

let server;
before(async () => {
  server = await Server.start();
  // What cameras, solver and store take for themselves is taken by then: the rest is the watchers'.
  for (let burst = 0; burst < 2; ++burst) {
    await completeBurst(20, () => {});
    await server.idle();
  }
}, { timeout: 240_000 });
after(() => server?.end());

// A WebSocket spelt out, so that it can misbehave.
function rawWatcher(reads) {
  const socket = connect(server.port, "127.0.0.1");
  socket.on("error", () => {});
  socket.write(`GET /api/v1/live HTTP/1.1\r\nHost: 127.0.0.1:${server.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: ${randomBytes(16).toString("base64")}\r\n\r\n`);
  socket.bytes = 0;
  socket.say = (text) => {
    const head = Buffer.from([0x81, 0x80 | text.length, 0, 0, 0, 0]);
    socket.write(Buffer.concat([head, Buffer.from(text)]));
  };
  if (reads) socket.on("data", (data) => { socket.bytes += data.length; });
  else socket.pause();
  return socket;
}

// As a browser does: wants all, and says so whenever it has dealt with a message.
function watcher() {
  const socket = rawWatcher(true);
  const got = setInterval(() => (socket.destroyed ? clearInterval(got) : socket.say("got")), 20);
  setTimeout(() => socket.say("want status thumbnails volume frame:cam00"), 100);
  return socket;
}

async function completeBurst(pulses, meanwhile) {
  const started = await server.post("capture", { kind: "burst", pulses });
  const before = server.residentKiB();
  let most = before;
  const watch = setInterval(() => { most = Math.max(most, server.residentKiB()); }, 100);
  try {
    await meanwhile();
    await server.until("the burst is over", async () => {
      const status = await server.get("status");
      return status.array?.phase === "idle" && status.array.capture === started.capture;
    });
  } finally {
    clearInterval(watch);
  }
  const receipt = await server.get(`captures/${started.capture}/receipt`);
  assert.equal(receipt.pulses, pulses);
  assert.equal(receipt.sets, pulses);
  for (const camera of receipt.cameras) assert.equal(camera.frames, pulses, `${camera.camera} lost frames`);
  return { grown_MiB: (most - before) / 1024 };
}

test("twenty watchers at once cost no frame", { timeout: 180_000 }, async (t) => {
  const watchers = [];
  t.after(() => watchers.forEach((socket) => socket.destroy()));
  const { grown_MiB } = await completeBurst(20, async () => {
    for (let i = 0; i < 20; ++i) watchers.push(watcher());
  });
  const sizes = watchers.map((w) => w.bytes);
  t.diagnostic(`memory grew by ${grown_MiB.toFixed(0)} MiB, watchers got ${Math.min(...sizes)} to ${Math.max(...sizes)} bytes`);
  assert.ok(Math.min(...sizes) > 500_000, "every one of them was shown pictures");
  assert.ok(grown_MiB < 150);
});

test("browsers that stop reading cost no frame and little memory", { timeout: 180_000 }, async (t) => {
  const stuck = [];
  t.after(() => stuck.forEach((socket) => socket.destroy()));
  const { grown_MiB } = await completeBurst(20, async () => {
    for (let i = 0; i < 10; ++i) {
      const socket = rawWatcher(false);
      setTimeout(() => {
        socket.say("want status thumbnails volume frame:cam00 frame:cam01 frame:cam02");
        for (let n = 0; n < 100; ++n) socket.say("got");
      }, 100);
      stuck.push(socket);
    }
  });
  t.diagnostic(`memory grew by ${grown_MiB.toFixed(0)} MiB`);
  assert.ok(grown_MiB < 150);
});

test("malformed frames and an upload of a gigabyte cost no frame", { timeout: 180_000 }, async (t) => {
  const { grown_MiB } = await completeBurst(15, async () => {
    for (let i = 0; i < 20; ++i) {
      const socket = rawWatcher(true);
      setTimeout(() => socket.write(randomBytes(4096)), 50);
    }
    const upload = connect(server.port, "127.0.0.1");
    upload.on("error", () => {});
    let answer = "";
    upload.on("data", (data) => { answer += data; });
    upload.write(`POST /api/v1/capture HTTP/1.1\r\nHost: 127.0.0.1:${server.port}\r\nContent-Length: 1000000000\r\n\r\n`);
    const block = Buffer.alloc(1 << 20, "x");
    for (let sent = 0; sent < 1000 && !upload.destroyed; ++sent) {
      if (!upload.write(block)) await new Promise((resolve) => { upload.once("drain", resolve); upload.once("close", resolve); });
    }
    assert.match(answer, /^HTTP\/1\.1 413/);
    upload.destroy();
  });
  t.diagnostic(`memory grew by ${grown_MiB.toFixed(0)} MiB`);
  assert.ok(grown_MiB < 150);
});
