import assert from "node:assert/strict";
import { afterEach, beforeEach, mock, test } from "node:test";

import { outsideImages } from "../outside_images.js";
import { installCanvas } from "./support/canvas.js";

let images;
let sent;
let events;
let isOn;
let eye;

beforeEach(() => {
  installCanvas();
  mock.timers.enable({ apis: ["setTimeout"] });
  [sent, events, isOn, eye] = [[], [], true, 0];
  images = outsideImages({ send: (message) => sent.push(message) }, {
    isOn: () => isOn,
    viewOf: (still) => ({ eye_m: [eye, 0, 0], still }),
    arrived: () => events.push("arrived"),
    rested: () => events.push("rested"),
  });
});
afterEach(() => mock.timers.reset());

/** Moves the viewer and requests the view. */
const move = (to) => {
  eye = to;
  images.again();
};
const take = (sequence) => images.take({ type: "outside", sequence, mime: "image/jpeg", lengths: [1], took_ms: 1 }, String(sequence));
const requests = () => sent.map(({ sequence, view }) => [sequence, view.eye_m[0], view.still]);

test("during a movement, one request is pending, and then the newest view is requested", async () => {
  [1, 2, 3].forEach(move);
  assert.deepEqual(requests(), [[1, 1, false]]);
  await take(1);
  assert.deepEqual(requests(), [[1, 1, false], [2, 3, false]]);
  await take(2);
  assert.equal(sent.length, 2);
  assert.equal(images.shown.view.eye_m[0], 3);
});

test("an image of full size follows at rest", async () => {
  move(1);
  mock.timers.tick(100);
  await take(1);
  move(2);
  await take(2);
  mock.timers.tick(149);
  assert.equal(sent.length, 2);
  mock.timers.tick(1);
  assert.deepEqual(requests()[2], [3, 2, true]);
  assert.equal(images.isStill(), false);
  await take(3);
  assert.equal(images.isStill(), true);
  assert.deepEqual(events, ["arrived", "arrived", "rested", "arrived"]);
});

test("an image that decodes after a newer one is dropped", async () => {
  const decode = globalThis.createImageBitmap;
  let release;
  let late;
  globalThis.createImageBitmap = async (blob) => {
    const bitmap = await decode(blob);
    if (bitmap.text !== "1") return bitmap;
    late = bitmap;
    await new Promise((resolve) => { release = resolve; });
    return bitmap;
  };
  move(1);
  const slow = take(1);
  move(2);
  await take(2);
  release();
  await slow;
  assert.equal(images.shown.sequence, 2);
  assert.deepEqual([late.isClosed, images.shown.bitmap.isClosed], [true, false]);
});

test("an image nobody requested is dropped", async () => {
  await take(7);
  assert.equal(images.shown, null);
});

test("a lost response is given up", () => {
  move(1);
  mock.timers.tick(2900);
  move(2);
  mock.timers.tick(99);
  assert.equal(sent.length, 1);
  mock.timers.tick(1);
  assert.deepEqual(requests()[1], [2, 2, false]);
});

test("nothing is requested while the view is off", () => {
  isOn = false;
  move(1);
  mock.timers.tick(5000);
  assert.deepEqual(sent, []);
});
