import assert from "node:assert/strict";
import { test } from "node:test";

import { project } from "../camera.js";
import { EDGES, drawHandles, drawWhite, handleAt, handlesOf } from "../handles.js";
import { FakeCanvas } from "./support/canvas.js";
import { CAMERA, CUBE, assertNear } from "./support/scene.js";

test("handles are projections of points around the object", () => {
  const handles = handlesOf(CAMERA, CUBE);
  assertNear(handles.top, project(CAMERA, [0, 0, -2]));
  // The ring's radius is 1.15 times half the base's diagonal; its knob is in front of the object.
  const radius = 1.15 * 0.5 * Math.SQRT2 / 2;
  assertNear(handles.turn, project(CAMERA, [0, -0.5, -2 + radius]));
  assertNear(handles.ring[0], handles.turn);
  assertNear(handles.ring[48], handles.turn, 1e-6);
  assertNear(handles.ring[12], project(CAMERA, [radius, -0.5, -2]));
  assertNear(handles.lift, project(CAMERA, [0, 0.5 * radius, -2]));
  assertNear(handles.size, project(CAMERA, [0.25, 0, -1.75]));
  assert.equal(handles.box.length, 8);
});

test("the nearest handle within reach is hit", () => {
  const handles = handlesOf(CAMERA, CUBE);
  for (const name of ["lift", "turn", "size"]) {
    const [u, v] = handles[name];
    assert.equal(handleAt(CAMERA, CUBE, [u + 3, v - 3], 10), name);
    assert.equal(handleAt(CAMERA, CUBE, [u + 3, v - 3], 4), null);
  }
  const between = [0, 1].map((i) => 0.6 * handles.lift[i] + 0.4 * handles.size[i]);
  assert.equal(handleAt(CAMERA, CUBE, between, 1000), "lift");
});

test("an object that reaches behind the camera has no handles", () => {
  const near = { ...CUBE, position_m: [0, -0.5, -0.2] };
  assert.equal(handlesOf(CAMERA, near), null);
  assert.equal(handleAt(CAMERA, near, [320, 240], 1000), null);
});

test("the edges connect corners that differ in one direction", () => {
  assert.equal(EDGES.length, 12);
  assert.equal(new Set(EDGES.map(String)).size, 12);
  const degree = Array(8).fill(0);
  EDGES.flat().forEach((corner) => { degree[corner] += 1; });
  assert.deepEqual(degree, Array(8).fill(3));
});

test("drawings are scaled to the canvas, and the dragged handle is white", () => {
  const { context } = new FakeCanvas(320, 240);
  drawHandles(context, 0.5, 16, CAMERA, CUBE, null, "turn");
  const { turn, size } = handlesOf(CAMERA, CUBE);
  const [turnKnob, sizeKnob] = context.of("arc");
  assertNear(turnKnob.slice(0, 3), [turn[0] / 2, turn[1] / 2, 0.55 * 16]);
  assertNear(sizeKnob.slice(0, 3), [size[0] / 2, size[1] / 2, 0.42 * 16]);
  const other = new FakeCanvas(320, 240).context;
  drawHandles(other, 0.5, 16, CAMERA, null, CUBE, null);
  // Two strokes for each edge of the hovered box, without knobs.
  assert.equal(other.of("stroke").length, 24);
  assert.equal(other.of("arc").length, 0);
  drawWhite(other, 0.5, 16, [100, 60]);
  assert.ok(other.of("arc").every(([u, v]) => u === 50 && v === 30));
});
