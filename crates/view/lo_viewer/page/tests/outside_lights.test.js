import assert from "node:assert/strict";
import { test } from "node:test";

import { project } from "../camera.js";
import { cameraOf, inFrame } from "../orbit.js";
import { onLevel, onSphere, rayOf, roomLightAt, roomLightDrag, shownAt } from "../outside_lights.js";
import { LAMP, SCENE, SUN, assertNear } from "./support/scene.js";

const UP = [0, 1, 0];
const CAMERA = cameraOf({ eye_m: [3, 4, 5], target_m: [0, 0, -2], fov_deg: 40, width: 800, height: 600 }, UP);
const seen = (point) => project(CAMERA, inFrame(CAMERA, point));

test("rays go through what they show", () => {
  const point = [1, -0.5, -3];
  assertNear(rayOf(CAMERA, seen(point)), [-2, -4.5, -8].map((along) => along / Math.hypot(2, 4.5, 8)), 1e-9);
  assertNear(onLevel(CAMERA, seen(point), [7, -0.5, 7], UP), point, 1e-9);
  // Above the horizon.
  assert.equal(onLevel(CAMERA, [400, -2000], [0, -1, 0], UP), null);
});

test("the nearest light is found, a sun beyond the room", () => {
  assertNear(shownAt(SUN, SCENE.extent), [1.65, 3.3 * Math.SQRT1_2, -3.65], 1e-9);
  const at = seen(LAMP.position_m);
  assert.equal(roomLightAt(CAMERA, [SUN, LAMP], SCENE.extent, [at[0] + 5, at[1]], 10)?.id, "A1");
  assert.equal(roomLightAt(CAMERA, [SUN, LAMP], SCENE.extent, [at[0] + 50, at[1]], 10), null);
  assert.equal(roomLightAt(CAMERA, [SUN, LAMP], SCENE.extent, seen(shownAt(SUN, SCENE.extent)), 10)?.id, "A2");
});

test("a lamp moves at its height, with Shift up and down, and stays near the room", () => {
  const from = seen(LAMP.position_m);
  const drag = roomLightDrag(CAMERA, UP, SCENE.extent, LAMP, from);
  assertNear(drag(seen([0.7, 0.5, -3]), false).change.at_m, [0.7, 0.5, -3], 1e-4);
  assertNear(drag(seen([0, 1.2, -2]), true).change.at_m, [0, 1.2, -2], 1e-4);
  assert.equal(drag(seen([0, 0.5, -40]), false), null);
});

test("a sun turns around the room on the viewer's side", () => {
  const drag = roomLightDrag(CAMERA, UP, SCENE.extent, SUN, [0, 0]);
  const target = [2 * 0.6, 3.3 * 0.6, -2 + 3.3 * 0.5291502622];
  const towards = onSphere(CAMERA, seen(target), SCENE.extent.middle_m, Math.hypot(1.2, 1.98, 3.3 * 0.5291502622));
  assertNear(towards, target, 1e-6);
  const command = drag(seen([0, 3.3, -2]), false);
  assert.deepEqual([command.do, command.light], ["turn-sun", "A2"]);
  assert.ok(Math.abs(command.elevation_deg - 90) < 1, `${command.elevation_deg}`);
});
