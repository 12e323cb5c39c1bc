import assert from "node:assert/strict";
import { test } from "node:test";

import { minus, project } from "../camera.js";
import { EDGES, drawDropLine, drawHandles, drawWhite, gizmoOf, handleAt, heightAboveFloor, segmentDistance } from "../handles.js";
import { levelAxes } from "../orbit.js";
import { FakeCanvas } from "./support/canvas.js";
import { CAMERA, CUBE, assertNear } from "./support/scene.js";

const LEVEL = levelAxes([0, 1, 0]);
const WHOLE = { left: 0, top: 0, right: 640, bottom: 480 };
/** 16 pixels. */
const REM = 16;
const gizmo = (object = CUBE, visible = WHOLE) => gizmoOf(CAMERA, object, LEVEL, visible, REM);
const isInside = ([u, v], { left, top, right, bottom }) => u >= left && u <= right && v >= top && v <= bottom;

test("arrows begin at the object's middle and follow the axes of the floor", () => {
  const { anchor_m, arrows, ring, size } = gizmo();
  assertNear(anchor_m, [0, -0.25, -2]);
  const rem_m = (REM * 2) / CAMERA.fx;
  const [right, up, ahead] = arrows;
  assert.deepEqual(arrows.map(({ name }) => name), ["right", "up", "ahead"]);
  assertNear(right.to, project(CAMERA, [4.6 * rem_m, -0.25, -2]), 1e-6);
  assertNear(up.to, project(CAMERA, [0, -0.25 + 4.6 * rem_m, -2]), 1e-6);
  // Towards the camera, not to cover the arrow up.
  assert.ok(ahead.to[1] > ahead.from[1] && Math.abs(ahead.to[0] - 320) < 1e-6);
  // The ring's radius is 1.15 times half the base's diagonal.
  const radius = 1.15 * 0.5 * Math.SQRT2 / 2;
  assertNear(ring[0], project(CAMERA, [0, -0.5, -2 + radius]));
  assertNear(ring[12], project(CAMERA, [radius, -0.5, -2]));
  assertNear(size, project(CAMERA, [0.25, 0, -1.75]));
});

test("all handles stay on the visible part of the photo", () => {
  const objects = [
    { ...CUBE, position_m: [5, -0.5, -2] },
    { ...CUBE, position_m: [-3, 2, -2] },
    { ...CUBE, size_m: [3, 4, 0.3] },
    { ...CUBE, size_m: [0.01, 0.01, 0.01] },
  ];
  for (const visible of [WHOLE, { left: 400, top: 300, right: 600, bottom: 450 }]) {
    for (const object of objects) {
      const { arrows, size, anchor_m } = gizmo(object, visible);
      assert.ok(isInside(project(CAMERA, anchor_m), visible));
      assert.ok(isInside(size, visible));
      assert.ok(arrows.length >= 2);
      for (const { from, to } of arrows) assert.ok(isInside(from, visible) && isInside(to, visible), `${from} ${to}`);
    }
  }
});

test("an object that reaches behind the camera has handles without a box, one behind it has none", () => {
  const near = gizmo({ ...CUBE, position_m: [0, -0.2, -0.2] });
  assert.equal(near.box, null);
  assert.ok(near.arrows.length > 0);
  assert.equal(gizmo({ ...CUBE, position_m: [0, -0.5, 1] }), null);
  assert.equal(handleAt(null, [320, 240], 1000), null);
});

test("arrows and the ring are hit along their whole length, the corner first", () => {
  const found = gizmo();
  for (const { name, from, to } of found.arrows) {
    const between = [0.3, 0.7].map((share) => from[0] * (1 - share) + to[0] * share).map((u, i) => [u, from[1] + (to[1] - from[1]) * [0.3, 0.7][i]]);
    for (const [u, v] of between) assert.equal(handleAt(found, [u, v], REM), name);
  }
  for (const i of [4, 20, 30]) assert.equal(handleAt(found, found.ring[i], REM), "turn");
  assert.equal(handleAt(found, found.size, REM), "size");
  assert.equal(handleAt(found, [10, 10], REM), null);
  assert.equal(handleAt(found, [found.ring[0][0], found.ring[0][1] + REM], REM), null);
});

test("distances from a segment are those of its nearest point", () => {
  assertNear([segmentDistance([5, 3], [0, 0], [10, 0]), segmentDistance([-3, 4], [0, 0], [10, 0]), segmentDistance([3, 4], [0, 0], [0, 0])], [3, 5, 5]);
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
  const found = gizmo();
  drawHandles(context, 0.5, REM, found, null, "size");
  const [square] = context.of("rect");
  assertNear(square, [found.size[0] / 2 - 0.5 * REM, found.size[1] / 2 - 0.5 * REM, REM, REM]);
  // The square is filled last.
  assert.equal(context.fillStyle, "#fff");
  const other = new FakeCanvas(320, 240).context;
  drawHandles(other, 0.5, REM, null, found, null);
  // Two strokes for each edge of the hovered box, without handles.
  assert.equal(other.of("stroke").length, 24);
  assert.equal(other.of("rect").length, 0);
  drawWhite(other, 0.5, 16, [100, 60]);
  assert.ok(other.of("arc").every(([u, v]) => u === 50 && v === 30));
});

test("a lifted object has a line down to the floor, with its height", () => {
  assert.equal(heightAboveFloor([3, -0.5, -2], [0, 1, 0], -1.4), 0.8999999999999999);
  const { context } = new FakeCanvas(640, 480);
  drawDropLine(context, 1, REM, CAMERA, CUBE.position_m, [0, 1, 0], -1.4);
  const [text, x, y] = context.of("fillText")[0];
  assert.equal(text, "0.9 m above the floor");
  assertNear(minus([x, y, 0], [...project(CAMERA, [0, -1.4, -2]), 0]), [0.9 * REM, 0, 0]);
  const standing = new FakeCanvas(640, 480).context;
  drawDropLine(standing, 1, REM, CAMERA, [0, -1.4, -2], [0, 1, 0], -1.4);
  assert.deepEqual(standing.calls, []);
});
