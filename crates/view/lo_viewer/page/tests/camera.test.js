import assert from "node:assert/strict";
import { test } from "node:test";

import { axes, complete, corners, cross, direction, dot, isInHull, minus, onPlane, project, times } from "../camera.js";
import { CAMERA, CUBE, assertNear } from "./support/scene.js";

test("projection follows the pinhole formula", () => {
  assert.deepEqual(project(CAMERA, [0, 0, -1]), [320, 240]);
  // One metre to the right and up, at 4 m: 320 / 4 pixels.
  assert.deepEqual(project(CAMERA, [1, 1, -4]), [400, 160]);
  assert.deepEqual(project({ ...CAMERA, fy: 160 }, [1, 1, -4]), [400, 200]);
  assert.equal(project(CAMERA, [0, 0, 0]), null);
  assert.equal(project(CAMERA, [1, 1, 4]), null);
});

test("a direction projects back to its pixel", () => {
  const camera = { ...CAMERA, fy: 300, cy: 200 };
  for (const pixel of [[0, 0], [320, 240], [17.5, 401.25]]) {
    assertNear(project(camera, times(direction(camera, pixel), 3)), pixel);
  }
});

test("a ray meets the floor where similar triangles say", () => {
  // The floor 1 m below: 160 pixels below the centre is a slope of 1/2.
  assertNear(onPlane(CAMERA, [320, 400], [0, -1, 0], [0, 1, 0]), [0, -1, -2]);
  assert.equal(onPlane(CAMERA, [320, 100], [0, -1, 0], [0, 1, 0]), null, "above the horizon");
  assert.equal(onPlane(CAMERA, [320, 240], [0, -1, 0], [0, 1, 0]), null, "at the horizon");
});

test("axes are right-handed and orthonormal for every up and rotation", () => {
  const ups = [[0, 1, 0], [0, -1, 0], [1, 0, 0], [0.6, 0.8, 0], [-0.48, 0.6, 0.64]];
  for (const up of ups) {
    for (const yaw_deg of [0, 90, -37, 200]) {
      const [x, y, z] = axes({ ...CUBE, up, yaw_deg });
      assertNear(y, up);
      assertNear([dot(x, x), dot(z, z), dot(x, y), dot(x, z), dot(y, z)], [1, 1, 0, 0, 0]);
      assertNear(cross(x, y), z);
    }
  }
});

test("an object turns counter-clockwise seen from above", () => {
  const [x, , z] = axes({ ...CUBE, yaw_deg: 90 });
  assertNear(x, [0, 0, -1]);
  assertNear(z, [1, 0, 0]);
});

test("corners span the object's size above its position", () => {
  const found = corners({ ...CUBE, size_m: [0.2, 0.4, 0.6], yaw_deg: 90 });
  const extent = [0, 1, 2].map((axis) => found.map((corner) => corner[axis]));
  // Width and length change places in a quarter turn.
  assertNear(extent.map((along) => Math.max(...along) - Math.min(...along)), [0.6, 0.4, 0.2]);
  assertNear([0, 1, 2, 3].map((i) => found[i][1]), Array(4).fill(-0.5));
  assertNear(minus(found[6], found[0]).map(Math.abs), [0.6, 0.4, 0.2]);
});

test("a hull contains its inside only", () => {
  const square = [[0, 0], [10, 0], [10, 10], [0, 10], [5, 5]];
  assert.ok(isInHull(square, [1, 9]));
  assert.ok(!isInHull(square, [-1, 5]));
  assert.ok(!isInHull(square, [11, 11]));
});

test("a list with null is not complete", () => {
  assert.deepEqual(complete([1, 0, 2]), [1, 0, 2]);
  assert.equal(complete([1, null]), null);
});
