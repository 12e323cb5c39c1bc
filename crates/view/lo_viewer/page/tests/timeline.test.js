import assert from "node:assert/strict";
import { test } from "node:test";

import { inWords, nearestFrame, neededLength, playedShare, rulerStep } from "../timeline.js";
import { assertNear } from "./support/scene.js";

test("times are rounded to frames", () => {
  assert.equal(nearestFrame(0.49, 2), 0.5);
  assert.equal(nearestFrame(-1, 24), 0);
  // Four decimals: 5 / 24 = 0.208333….
  assert.equal(nearestFrame(0.2, 24), 0.2083);
  for (const time of [0, 0.2083, 1.3333, 7.9583]) assert.equal(nearestFrame(time, 24), time, "frames stay");
});

test("playback takes as long as the frames, and starts again", () => {
  // 25 frames at 24 frames/s: one second.
  assertNear([playedShare(0, 0.25, 25, 24), playedShare(0.5, 0.25, 25, 24), playedShare(0.5, 0.75, 25, 24)], [0.25, 0.75, 0.25]);
  // A single frame has no length; the clock goes on.
  assertNear([playedShare(0, 0.25, 1, 24)], [0.25]);
});

test("the timeline shows the last keyframe with a second to spare, and the current time", () => {
  assert.equal(neededLength(null, 0), 5);
  assert.equal(neededLength([0, 4.2], 0), 6);
  assert.equal(neededLength([0, 1], 8.5), 9);
});

test("the ruler has at most twelve steps", () => {
  assert.deepEqual([5, 6, 7, 24, 61, 3600].map(rulerStep), [0.5, 0.5, 1, 2, 10, 300]);
  for (let length = 5; length <= 7200; length++) assert.ok(length / rulerStep(length) <= 12, `${length} s`);
  assert.equal(rulerStep(1e6), 600);
});

test("remaining times are in seconds, then in minutes", () => {
  assert.deepEqual([0.2, 89.9, 90, 601].map(inWords), ["1 s", "90 s", "2 min", "11 min"]);
});
