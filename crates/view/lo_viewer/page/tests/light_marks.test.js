import assert from "node:assert/strict";
import { test } from "node:test";

import { direction, project } from "../camera.js";
import { arrowsOf, colorOf, drawLights, hintOf, lightDrag, lightHandleAt, lightsOnPhoto, marksOf, placeOf, shadowsOf, sunAngles } from "../light_marks.js";
import { overhead } from "../lights.js";
import { levelAxes } from "../orbit.js";
import { FakeCanvas } from "./support/canvas.js";
import { CAMERA, CUBE, LAMP, SCENE, SUN, assertNear } from "./support/scene.js";

const LEVEL = levelAxes([0, 1, 0]);
const WHOLE = { left: 0, top: 0, right: 640, bottom: 480 };

test("angles of a sun are to the right of the axis and above the horizon", () => {
  assertNear(Object.values(sunAngles(SUN.direction, LEVEL)), [45, 45], 1e-6);
  assertNear(Object.values(sunAngles([-2, 0, 0], LEVEL)), [-90, 0], 1e-6);
});

test("marks are where the photo shows the lights", () => {
  const lights = [LAMP, { ...LAMP, id: "L1", position_m: [0, 0, 3] }, SUN, { ...LAMP, id: "L2", position_m: [9, 0, -2] }];
  const marks = marksOf(CAMERA, lights);
  assert.deepEqual(marks.map(({ light }) => light.id), ["A1"], "the sun is above the photo");
  assertNear(marks[0].at, [320, 160]);
  const low = { ...SUN, direction: [0.5, 0.5, -Math.SQRT1_2] };
  assertNear(marksOf(CAMERA, [low])[0].at, project(CAMERA, low.direction), 1e-6);
});

test("a light is where it was moved, and has the colour that it was given", () => {
  assert.deepEqual(placeOf({ ...LAMP, changed: { at_m: [1, 2, -3] } }), [1, 2, -3]);
  assert.equal(placeOf(SUN), null);
  assert.equal(colorOf(LAMP), "#ffe1bc");
  assert.equal(colorOf({ ...LAMP, changed: { color: { rgb: [0, 1, 0] } } }), "#00ff00");
  assert.equal(colorOf({ ...LAMP, changed: { on: false } }), "#9a9a9a");
});

test("the end of a shadow stays in the visible part", () => {
  const object = { ...CUBE, shadows: [{ light: "A2", pixel: [900, 300] }, { light: "A9", pixel: [1, 1] }] };
  const [shadow, ...others] = shadowsOf(CAMERA, object, [SUN], WHOLE, 16);
  assert.deepEqual([shadow.tip, others], [[624, 300], []]);
  assertNear(shadow.top, project(CAMERA, [0, 0, -2]));
});

test("a lamp has arrows in the axes of the floor, a sun has none", () => {
  const found = arrowsOf(CAMERA, LAMP, LEVEL, WHOLE, 16);
  assertNear(found.anchor_m, LAMP.position_m);
  assert.deepEqual(found.arrows.map(({ name }) => name), ["right", "up", "ahead"]);
  assert.equal(arrowsOf(CAMERA, SUN, LEVEL, WHOLE, 16), null);
});

test("a new lamp is in the photo, and its mark is dragged even where an arrow begins", () => {
  assertNear(project(CAMERA, overhead({ openScene: () => SCENE })), [320, 96], 1e-9);
  const light = { ...LAMP, position_m: [0, 1.45, -2] };
  const marks = marksOf(CAMERA, [light]);
  const lights = { marks, selected: arrowsOf(CAMERA, light, LEVEL, WHOLE, 16), shadows: [] };
  assert.deepEqual([lightHandleAt(lights, marks[0].at, 16).kind, lightHandleAt(lights, [marks[0].at[0] + 200, 100], 16)], ["mark", null]);
});

test("a sun in the photo follows the pointer", () => {
  const low = { ...SUN, direction: [0.5, 0.5, -Math.SQRT1_2] };
  const page = { openScene: () => SCENE };
  const at = project(CAMERA, low.direction);
  const command = lightDrag(page, { kind: "mark", mark: { light: low, at } }, at)([320, 160], false);
  assert.equal(command.do, "turn-sun");
  assertNear([command.azimuth_deg, command.elevation_deg], [0, Math.atan(0.25) * (180 / Math.PI)], 1e-6);
  assertNear(direction(CAMERA, [320, 160]), [0, 0.25, -1]);
});

test("lights are drawn on the canvas's scale, with their names", () => {
  const { context } = new FakeCanvas(320, 240);
  const page = {
    scene: SCENE, view: { lights: [LAMP, SUN], objects: [] }, selectedLight: "A1",
    selected: () => ({ ...CUBE, shadows: [{ light: "A2", pixel: [200, 400] }] }), visible: () => WHOLE, reach: () => 16,
  };
  const lights = lightsOnPhoto(page);
  drawLights(context, 0.5, 16, lights, "A1", null);
  assert.deepEqual(context.of("fillText").map(([text]) => text), ["shadow in A2", "A1"]);
  // The disc of the shadow's end, of the lamp, and the ring of the selected one.
  assert.deepEqual(context.of("arc").map(([x, y]) => [x, y]), [[100, 200], [160, 80], [160, 80]]);
  assert.ok(hintOf({ kind: "mark", mark: lights.marks[0] }).includes("Shift") && hintOf({ kind: "shadow", shadow: lights.shadows[0] }).includes("sun"));
});
