import assert from "node:assert/strict";
import { test } from "node:test";

import { dot, project } from "../camera.js";
import { FOV_DEG, cameraOf, eyeOf, inFrame, inWords, levelAxes, orbitAround, pan, rotate, zoom } from "../orbit.js";
import { assertNear } from "./support/scene.js";

const UP = [0, 1, 0];
const ORBIT = { target_m: [0, 0, -2], yaw_deg: 0, pitch_deg: 0, distance_m: 5 };

const viewOf = (orbit, up = UP) => ({ eye_m: eyeOf(orbit, levelAxes(up)), target_m: orbit.target_m, fov_deg: FOV_DEG, width: 200, height: 100 });

test("level axes are orthonormal and horizontal, also for a camera that looks straight down or up", () => {
  for (const up of [[0, 1, 0], [0.6, 0.8, 0], [0, 0, 1], [0, 0, -1], [0, 0.6, -0.8]]) {
    const { right, ahead } = levelAxes(up);
    assertNear([dot(right, right), dot(ahead, ahead), dot(right, up), dot(ahead, up), dot(right, ahead)], [1, 1, 0, 0, 0]);
  }
  assertNear(levelAxes(UP).right, [1, 0, 0]);
  assertNear(levelAxes(UP).ahead, [0, 0, -1]);
  // Seen from above, the image's top is ahead.
  assertNear(levelAxes([0, 0, 1]).ahead, [0, 1, 0]);
});

test("the eye is on a sphere around the target", () => {
  assertNear(eyeOf(ORBIT, levelAxes(UP)), [0, 0, 3]);
  assertNear(eyeOf({ ...ORBIT, yaw_deg: 90 }, levelAxes(UP)), [5, 0, -2]);
  assertNear(eyeOf({ ...ORBIT, pitch_deg: 30 }, levelAxes(UP)), [0, 2.5, -2 + 5 * Math.cos(Math.PI / 6)]);
});

test("the target is at the image centre, and the field of view is vertical", () => {
  const orbit = { ...ORBIT, yaw_deg: 28, pitch_deg: 32 };
  const camera = cameraOf(viewOf(orbit), UP);
  assertNear(project(camera, inFrame(camera, orbit.target_m)), [100, 50]);
  const straight = cameraOf(viewOf(ORBIT), UP);
  const top = 5 * Math.tan((FOV_DEG * Math.PI) / 360);
  assertNear(project(straight, inFrame(straight, [0, top, -2])), [100, 0]);
});

test("the first orbit shows the whole room", () => {
  const { distance_m, target_m } = orbitAround({ middle_m: [1, 0, -2], radius_m: 3 });
  assertNear(target_m, [1, 0, -2]);
  assertNear([Math.atan(3 / distance_m)], [(FOV_DEG * Math.PI) / 360]);
  assert.equal(orbitAround({ middle_m: [0, 0, 0], radius_m: 1e6 }).distance_m, 100);
});

test("rotation wraps the yaw and stops short of the poles", () => {
  const orbit = { ...ORBIT, yaw_deg: 170 };
  rotate(orbit, 20, 200);
  assertNear([orbit.yaw_deg, orbit.pitch_deg], [-170, 88]);
  rotate(orbit, 0, -500);
  assert.equal(orbit.pitch_deg, -88);
});

test("panning by shares of the height moves the image by as much", () => {
  const orbit = { ...ORBIT, yaw_deg: 28, pitch_deg: 32, target_m: [0, 0, -2] };
  pan(orbit, UP, 0.2, -0.1);
  const camera = cameraOf(viewOf(orbit), UP);
  // The former target, in an image 100 pixels high.
  assertNear(project(camera, inFrame(camera, [0, 0, -2])), [80, 40], 1e-6);
  pan(orbit, UP, 1e9, 0);
  assert.ok(orbit.target_m.every((along) => Math.abs(along) <= 100));
});

test("zoom is limited", () => {
  const orbit = { ...ORBIT };
  zoom(orbit, 0.5);
  assert.equal(orbit.distance_m, 2.5);
  zoom(orbit, 1e-9);
  assert.equal(orbit.distance_m, 0.3);
});

test("an orbit is described in words", () => {
  assert.equal(inWords({ ...ORBIT, yaw_deg: -27.6, pitch_deg: 32, distance_m: 8.24 }), "28° from the left, 32° from above, 8.2 m");
  assert.equal(inWords({ ...ORBIT, yaw_deg: 190, pitch_deg: -5 }), "170° from the left, 5° from below, 5.0 m");
});
