import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { cross, dot } from "../camera.js";
import { across, clippedNear, drawLines } from "../outside_lines.js";
import { FakeCanvas, installCanvas } from "./support/canvas.js";
import { installDocument } from "./support/dom.js";
import { CUBE, SCENE, assertNear } from "./support/scene.js";

const VIEW = { eye_m: [0, 0, 6], target_m: [0, 0, -2], fov_deg: 40, width: 200, height: 150 };
const LAMP = { id: "lamp 1", kind: "lamp", origin: "seen", radiance: [2, 1, 1], position_m: [0, 1, -2], direction: [0, -1, 0], area_m2: 0.1, changed: {} };

let context;

beforeEach(() => {
  installCanvas();
  installDocument();
  context = new FakeCanvas(400, 300).context;
});

const pageWith = (view) => ({ openScene: () => SCENE, view, selectedId: 1, selectedLight: null, isSelected: (id) => id === 1 });
/** Returns the position of a label without its offset in rem (16 pixels), or undefined. */
const label = (text, [right, down]) => {
  const call = context.of("fillText").find(([shown]) => shown === text);
  return call && [call[1] - 16 * right, call[2] - 16 * down];
};

test("lines are clipped in front of the viewer", () => {
  assert.equal(clippedNear([0, 0, 1], [0, 0, 0]), null);
  assert.deepEqual(clippedNear([0, 0, -1], [1, 0, -2]), [[0, 0, -1], [1, 0, -2]]);
  const [far, near] = clippedNear([1, 0, 0.98], [0, 0, -1.02]);
  assertNear(far, [0, 0, -1.02]);
  assertNear(near, [0.5, 0, -0.02]);
});

test("two vectors across a normal complete a frame", () => {
  for (const normal of [[0, 1, 0], [-1, 0, 0], [0.6, 0, 0.8], [0.48, 0.6, -0.64]]) {
    const [x, y] = across(normal);
    assertNear([dot(x, x), dot(y, y), dot(x, y), dot(x, normal)], [1, 1, 0, 0]);
    assertNear(cross(x, y), normal);
  }
});

test("labels are where the canvas shows their points", () => {
  drawLines(context, VIEW, pageWith({ objects: [CUBE], lights: [LAMP] }), null, [1, 0, -2]);
  // The canvas has two pixels for each of the image; 8 m away a metre is this long.
  const metre = (2 * 75) / Math.tan(Math.PI / 9) / 8;
  assertNear(label("lamp 1", [0.5, -0.5]), [200, 150 - metre], 1e-6);
  assertNear(label("probe", [0.5, 1]), [200 + metre, 150], 1e-6);
  assertNear(label("cube", [-0.5, -0.9]), [200, 150], 1e-6);
  // Half the camera's height; the camera is 6 m away.
  assertNear(label("1.40 m", [0.5, 0]), [200, 150 + 0.7 * metre * 8 / 6], 1e-6);
  assert.ok(label("camera", [0, 0]) && label("ahead", [0, 0]));
});

test("a moved light is where it was moved, and one that is off is dashed", () => {
  const dashes = (lights) => {
    context.calls.length = 0;
    drawLines(context, VIEW, pageWith({ objects: [], lights }), null, null);
    return context.of("setLineDash").filter(([[first]]) => first === 0.25 * 16).length;
  };
  assert.equal(dashes([LAMP]), 0);
  // The ring and the arrow.
  assert.equal(dashes([{ ...LAMP, changed: { on: false, at_m: [0, 0, -2] } }]), 2);
  assertNear(label("lamp 1", [0.5, -0.5]), [200, 150], 1e-6);
});

test("the photo in the frustum is drawn in tiles that cover it", () => {
  drawLines(context, VIEW, pageWith(null), { width: 256, height: 192 }, null);
  const tiles = context.of("drawImage");
  assert.equal(tiles.length, 64);
  assert.deepEqual(tiles[0].slice(1, 5), [0, 0, 33, 25]);
  assert.deepEqual(tiles[63].slice(1, 5), [224, 168, 32, 24]);
  const [, , , , x, y] = context.of("setTransform")[0];
  const corner = context.of("setTransform")[63];
  // The camera looks away from the viewer: the photo is upright, its left on the left.
  assert.ok(x < 200 && y < 150 && corner[4] > 200 && corner[5] > 150);
});
