import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";

import { connect } from "../server.js";

class FakeSocket {
  static OPEN = 1;
  static all = [];

  constructor(address) {
    Object.assign(this, { address: String(address), readyState: 0, sent: [] });
    FakeSocket.all.push(this);
  }

  send(text) { this.sent.push(text); }
}

/** Encodes a message with images as the program does. */
function binary(message, ...images) {
  const json = new TextEncoder().encode(JSON.stringify(message));
  const bytes = new Uint8Array(4 + json.length + images.flat().length);
  new DataView(bytes.buffer).setUint32(0, json.length, true);
  bytes.set(json, 4);
  bytes.set(images.flat(), 4 + json.length);
  return bytes.buffer;
}

/** Close event of a lost connection (RFC 6455, 7.1.5). */
const LOST = { code: 1006, reason: "" };

beforeEach(() => {
  FakeSocket.all = [];
  globalThis.WebSocket = FakeSocket;
  globalThis.location = new URL("http://127.0.0.1:8080/0123456789abcdef/");
});

test("the socket is below the page's address, encrypted if the page is", () => {
  connect(() => {}, () => {});
  globalThis.location = new URL("https://example.org/room/0123456789abcdef/");
  connect(() => {}, () => {});
  assert.deepEqual(FakeSocket.all.map(({ address }) => address), [
    "ws://127.0.0.1:8080/0123456789abcdef/socket",
    "wss://example.org/room/0123456789abcdef/socket",
  ]);
});

test("text messages have no images, and binary ones are divided by their lengths", () => {
  const received = [];
  connect((message, images) => received.push([message, images.map((image) => [...image])]), () => {});
  const [socket] = FakeSocket.all;
  assert.equal(socket.binaryType, "arraybuffer");
  socket.onmessage({ data: '{"type":"refused","why":"–"}' });
  // Two bytes in UTF-8, so that the length in bytes differs from that in characters.
  const probe = { type: "probe", pixel: [1, 2], note: "é", lengths: [2, 0, 3] };
  socket.onmessage({ data: binary(probe, [1, 2], [], [3, 4, 5]) });
  assert.deepEqual(received, [[{ type: "refused", why: "–" }, []], [probe, [[1, 2], [], [3, 4, 5]]]]);
});

test("messages are sent only while there is a connection", () => {
  const send = connect(() => {}, () => {});
  const [socket] = FakeSocket.all;
  assert.equal(send({ type: "undo" }), false);
  socket.readyState = FakeSocket.OPEN;
  assert.equal(send({ type: "redo" }), true);
  assert.deepEqual(socket.sent, ['{"type":"redo"}']);
});

test("a refused page is told why, and no other reason is shown", () => {
  const reasons = [];
  connect(() => {}, (why) => reasons.push(why));
  const [socket] = FakeSocket.all;
  socket.onclose({ code: 4001, reason: "too many pages are open" });
  socket.onclose(LOST);
  socket.onclose({ code: 1001, reason: "going away" });
  assert.deepEqual(reasons, ["too many pages are open", "", ""]);
});

test("a lost connection is opened again, less and less often until it succeeds", () => {
  mock.timers.enable({ apis: ["setTimeout"] });
  let lost = 0;
  connect(() => {}, () => { lost += 1; });
  const waits = [];
  for (let i = 0; i < 7; i++) {
    FakeSocket.all.at(-1).onclose(LOST);
    let wait = 0;
    for (const before = FakeSocket.all.length; FakeSocket.all.length === before; wait += 50) mock.timers.tick(50);
    waits.push(wait);
  }
  assert.deepEqual(waits, [250, 500, 1000, 2000, 4000, 5000, 5000]);
  assert.equal(lost, 7);
  FakeSocket.all.at(-1).onmessage({ data: '{"type":"refused","why":""}' });
  FakeSocket.all.at(-1).onclose(LOST);
  mock.timers.tick(250);
  assert.equal(FakeSocket.all.length, 9);
  mock.timers.reset();
});
