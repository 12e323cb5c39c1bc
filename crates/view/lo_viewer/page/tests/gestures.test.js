import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { project } from "../camera.js";
import { aboveFloor, listen, scaled } from "../gestures.js";
import { gizmoOf } from "../handles.js";
import { lightsOnPhoto } from "../light_marks.js";
import { levelAxes } from "../orbit.js";
import { selecting } from "../selection.js";
import { FakeElement, installDocument } from "./support/dom.js";
import { CAMERA, CUBE, LAMP, SCENE, SUN, assertNear } from "./support/scene.js";

const FIELD = "input:not([type=range]):not([type=checkbox]), select, dialog[open]";
const PANEL = "aside, header, footer, #timeline";
const BASE = project(CAMERA, CUBE.position_m);
/** A point on the object that is on none of its handles. */
const SIDE = [BASE[0] + 25, BASE[1] - 15];
const WHOLE = { left: 0, top: 0, right: 640, bottom: 480 };
const gizmoOfObject = (object) => gizmoOf(CAMERA, object, levelAxes([0, 1, 0]), WHOLE, 16);

let stage;
let page;
/** Previewed commands and sent messages, in order. */
let done;

beforeEach(() => {
  installDocument();
  done = [];
  stage = new FakeElement();
  page = {
    scene: SCENE, view: { objects: [CUBE], lights: [] }, selectedId: null, alsoSelected: [], selectedLight: null, hovered: null, picking: null,
    keys: { k: () => done.push("key k") },
    openScene: () => SCENE,
    selected: () => page.view.objects.find(({ id }) => id === page.selectedId) ?? null,
    photoPosition: ({ at }) => at,
    reach: () => 8,
    gizmo: () => page.selected() && gizmoOfObject(page.selected()),
    visible: () => WHOLE,
    photoLights: () => lightsOnPhoto(page),
    hint: (text) => { page.hinted = text; },
    startPan: () => done.push("pan"),
    zoom: (direction) => done.push(`zoom ${direction}`),
    hover() {},
    redraw() {},
    preview: (command) => done.push(command),
    send: (message) => done.push(message),
  };
  selecting(page, () => {});
  listen(stage, page);
});

const press = (at, shiftKey = false) => stage.fire("pointerdown", { button: 0, at, shiftKey });
const moveTo = (at, shiftKey = false) => stage.fire("pointermove", { at, shiftKey });
const key = (name, more = {}) => document.fire("keydown", { key: name, ctrlKey: false, metaKey: false, shiftKey: false, ...more });

test("a drag previews positions of the base, and commits at the end", () => {
  // Pressed on the object's side, above the base.
  press(SIDE);
  assert.equal(page.selectedId, 1);
  assert.deepEqual([page.gesture().handle, page.gesture().object], ["move", 1]);
  moveTo([SIDE[0] + 30, SIDE[1] + 10]);
  stage.fire("pointerup");
  assert.deepEqual(done, [{ do: "drag", object: 1, to: [BASE[0] + 30, BASE[1] + 10] }, { type: "commit" }]);
  assert.equal(page.gesture(), null);
});

test("Escape cancels a drag, and nothing is committed after it", () => {
  press(SIDE);
  moveTo([BASE[0] + 30, BASE[1]]);
  key("Escape");
  stage.fire("pointerup");
  assert.deepEqual(done.slice(1), [{ type: "cancel" }]);
  assert.equal(page.selectedId, 1, "the next Escape clears the selection");
  key("Escape");
  assert.equal(page.selectedId, null);
});

test("a click without a movement is not a step of the history", () => {
  press(SIDE);
  stage.fire("pointerup");
  press([5, 5]);
  assert.deepEqual(done, ["pan"], "beside objects, the photo is moved");
  assert.equal(page.selectedId, null);
});

test("the nearer of two objects is selected", () => {
  page.view.objects = [{ ...CUBE, id: 2, position_m: [0, -0.75, -3], size_m: [0.75, 0.75, 0.75] }, CUBE];
  press(SIDE);
  assert.equal(page.selectedId, 1);
});

test("hidden and locked objects are not selected in the photo", () => {
  for (const state of [{ is_hidden: true }, { is_locked: true }]) {
    page.view.objects = [{ ...CUBE, ...state }];
    press(SIDE);
    assert.equal(page.selectedId, null);
  }
});

/** The cube, and another one 1 m to its right. */
const TWO = [CUBE, { ...CUBE, id: 2, position_m: [1, -0.5, -2] }];

test("several objects are selected with Shift, and move, turn and go together", () => {
  page.view.objects = TWO;
  press(SIDE);
  stage.fire("pointerup");
  press([SIDE[0] + 160, SIDE[1]], true);
  assert.deepEqual([page.selectedId, page.alsoSelected], [2, [1]]);
  assert.equal(page.gesture(), null);
  // A drag of one moves both by the same number of pixels, in one step.
  press(SIDE);
  moveTo([SIDE[0] + 10, SIDE[1] - 4]);
  stage.fire("pointerup");
  const drag = (object, u) => ({ do: "drag", object, to: [u, BASE[1] - 4] });
  const [command, end] = done;
  assert.deepEqual(end, { type: "commit" });
  assert.deepEqual([command.do, command.commands.map(({ object }) => object)], ["together", [1, 2]]);
  command.commands.forEach((part, i) => assertNear(part.to, drag(0, BASE[0] + 10 + 160 * i).to, 1e-6));
  done.length = 0;
  key("]");
  key("Delete");
  assert.deepEqual(done.map(({ command: { do: name, commands } }) => [name, commands.map((part) => part.do)]), [["together", ["turn", "turn"]], ["together", ["delete", "delete"]]]);
  // A click without a drag selects one alone; Shift takes one away.
  press(SIDE);
  stage.fire("pointerup");
  assert.deepEqual([page.selectedId, page.alsoSelected], [1, []]);
  press(SIDE, true);
  assert.equal(page.selectedId, null);
});

test("a locked object of the selection stays where it is", () => {
  page.view.objects = [CUBE, { ...TWO[1], is_locked: true }];
  page.select(1);
  page.select(2, true);
  press(SIDE);
  moveTo([SIDE[0] + 10, SIDE[1]]);
  assert.deepEqual(done.map((command) => [command.do, command.object]), [["drag", 1]]);
});

test("a light is dragged across the view at its depth, with Shift along surfaces", () => {
  page.view.lights = [LAMP];
  const at = project(CAMERA, LAMP.position_m);
  moveTo(at);
  assert.ok(page.hinted.startsWith("A1: drag"));
  press([at[0] + 2, at[1]]);
  assert.deepEqual([page.selectedLight, page.selectedId, page.gesture().handle, page.gesture().object], ["A1", null, "mark", null]);
  // 64 pixels are 0.4 m at a depth of 2 m.
  moveTo([at[0] + 2 - 64, at[1]]);
  moveTo([at[0] + 2, at[1] + 100], true);
  stage.fire("pointerup");
  assert.deepEqual(done, [
    { do: "set-light", light: "A1", change: { at_m: [-0.4, 0.5, -2] } },
    { do: "drag-light", light: "A1", to: [at[0], at[1] + 100] },
    { type: "commit" },
  ]);
});

test("arrows and keys move the selected light, and Delete removes an added one", () => {
  page.view.lights = [LAMP];
  page.selectLight("A1");
  const up = page.photoLights().selected.arrows.find(({ name }) => name === "up");
  const from = [0, 1].map((i) => (up.from[i] + up.to[i]) / 2);
  press(from);
  assert.equal(page.gesture().handle, "up");
  moveTo([from[0], from[1] - 32]);
  stage.fire("pointerup");
  key("ArrowLeft");
  key("Delete");
  assertNear(done[0].change.at_m, [0, 0.7, -2], 1e-3);
  assert.deepEqual(done.slice(2).map(({ command }) => command.change?.at_m ?? command.do), [[-0.05, 0.5, -2], "remove-light"]);
  page.view.lights = [{ ...LAMP, origin: "guessed" }];
  assert.equal(key("Delete").defaultPrevented, false);
});

test("the sun is aimed by the end of the selected object's shadow", () => {
  page.view.lights = [SUN];
  page.view.objects = [{ ...CUBE, shadows: [{ light: "A2", pixel: [200, 400] }] }];
  press([200, 400]);
  assert.equal(page.gesture(), null, "shadows are those of the selected object");
  page.select(1);
  done.length = 0;
  press([203, 398]);
  assert.deepEqual([page.gesture().handle, page.selectedId], ["shadow", 1]);
  moveTo([150, 410]);
  stage.fire("pointerup");
  assert.deepEqual(done, [{ do: "aim-sun", light: "A2", object: 1, to: [150, 410] }, { type: "commit" }]);
});

test("the ring turns by the angle around the base, seen from above", () => {
  page.selectedId = 1;
  const { ring } = page.gizmo();
  press(ring[4]);
  assert.equal(page.gesture().handle, "turn");
  // A quarter of the ring.
  moveTo(ring[16]);
  assert.deepEqual(done, [{ do: "turn", object: 1, yaw_deg: 90 }]);
});

test("an animated object may turn by more than half a turn, another one is wrapped", () => {
  for (const [path, expected] of [[null, -100], [{ interpolation: "linear", keyframes: [] }, 260]]) {
    done.length = 0;
    page.view.objects = [{ ...CUBE, yaw_deg: 170, path }];
    page.selectedId = 1;
    const { ring } = page.gizmo();
    press(ring[4]);
    moveTo(ring[16]);
    stage.fire("pointercancel");
    assert.deepEqual(done, [{ do: "turn", object: 1, yaw_deg: expected }, { type: "cancel" }]);
  }
});

/** Returns the photo position at a share of an arrow. */
const onArrow = (name, share) => {
  const { from, to } = page.gizmo().arrows.find((arrow) => arrow.name === name);
  return [0, 1].map((i) => from[i] + share * (to[i] - from[i]));
};

test("the arrow up lifts along gravity, and not below the floor", () => {
  page.selectedId = 1;
  const from = onArrow("up", 0.6);
  press(from);
  assert.equal(page.gesture().handle, "up");
  // 0.3 m at a depth of 2 m.
  moveTo([from[0], from[1] - (0.3 * CAMERA.fy) / 2]);
  assert.equal(done[0].do, "place");
  assertNear(done[0].place.position, [0, -0.2, -2], 1e-6);
  moveTo([from[0], from[1] + 400]);
  assertNear(done[1].place.position, [0, -1.4, -2], 1e-6);
});

test("the arrow to the right moves what stands along its surface, and what floats in the air", () => {
  for (const rests of [true, false]) {
    done.length = 0;
    page.view.objects = [{ ...CUBE, rests }];
    page.selectedId = 1;
    const from = onArrow("right", 0.5);
    press(from);
    // 0.25 m at a depth of 2 m.
    moveTo([from[0] + 40, from[1]]);
    stage.fire("pointerup");
    if (rests) assertNear(done[0].to, project(CAMERA, [0.25, -0.5, -2]), 1e-6);
    else assertNear(done[0].place.position, [0.25, -0.5, -2], 1e-6);
  }
});

test("the arrow ahead follows the ray that passes nearest to it", () => {
  page.view.objects = [{ ...CUBE, rests: false }];
  page.selectedId = 1;
  const [from, to] = [-1.8, -3].map((z) => project(CAMERA, [0, -0.25, z]));
  press(from);
  assert.equal(page.gesture().handle, "ahead");
  moveTo(to);
  assertNear(done[0].place.position, [0, -0.5, -3.2], 1e-6);
});

test("the corner scales by the distance from the middle", () => {
  page.selectedId = 1;
  const { size, anchor_m } = page.gizmo();
  const middle = project(CAMERA, anchor_m);
  press(size);
  moveTo([middle[0] + 2 * (size[0] - middle[0]), middle[1] + 2 * (size[1] - middle[1])]);
  moveTo(middle);
  assert.deepEqual(done.map((command) => command.size), [{ height: 1 }, { height: 0.01 }], "at least 2 %");
});

test("while white is picked, a click gives the middle of its pixel", () => {
  const picked = [];
  page.picking = (pixel) => picked.push(pixel);
  press([10.2, 20.9]);
  press([-1, 20]);
  press([640, 20]);
  key("Escape");
  assert.deepEqual(picked, [[10.5, 20.5], null]);
  assert.equal(page.selectedId, null);
});

test("keys undo and redo", () => {
  key("z", { ctrlKey: true });
  key("Z", { ctrlKey: true, shiftKey: true });
  key("y", { metaKey: true });
  assert.deepEqual(done, [{ type: "undo" }, { type: "redo" }, { type: "redo" }]);
});

test("keys edit the selected object", () => {
  assert.equal(key("ArrowLeft").defaultPrevented, false, "nothing is selected");
  page.selectedId = 1;
  const commands = [
    ["ArrowLeft", {}, { do: "drag", object: 1, to: [BASE[0] - 6.4, BASE[1]] }],
    ["ArrowDown", { shiftKey: true }, { do: "drag", object: 1, to: [BASE[0], BASE[1] + 0.64] }],
    ["PageUp", {}, { do: "place", object: 1, place: { position: [0, -0.48, -2] } }],
    ["]", {}, { do: "turn", object: 1, yaw_deg: -5 }],
    ["+", {}, { do: "size", object: 1, size: { height: 0.525 } }],
    ["g", {}, { do: "put-down", object: 1 }],
    ["h", {}, { do: "show", object: 1, is_shown: false }],
    ["L", {}, { do: "lock", object: 1, is_locked: true }],
    ["PageDown", {}, { do: "place", object: 1, place: { position: [0, -0.52, -2] } }],
    ["d", { ctrlKey: true }, { do: "duplicate", object: 1 }],
    ["Delete", {}, { do: "delete", object: 1 }],
  ];
  for (const [name, more, expected] of commands) {
    done.length = 0;
    assert.equal(key(name, more).defaultPrevented, true, name);
    assert.deepEqual(done, [{ type: "command", command: expected }], name);
  }
});

test("an object behind the camera can be turned and deleted, but not dragged", () => {
  page.view.objects = [{ ...CUBE, position_m: [0, 0, 1] }];
  page.selectedId = 1;
  for (const name of ["ArrowLeft", "[", "Delete"]) key(name);
  assert.deepEqual(done.map(({ command }) => command.do), ["turn", "delete"]);
});

test("keys belong to a field in which the user types, and some to the focused control", () => {
  page.selectedId = 1;
  const [field, panel] = [new FakeElement(), new FakeElement()];
  [field.matches, panel.matches] = [[FIELD], [PANEL]];
  // Events reach the document with the element as their target.
  for (const element of [field, panel]) element.addEventListener("keydown", (event) => {
    const atDocument = Object.assign(new Event("keydown", { cancelable: true }), { key: event.key, ctrlKey: false, metaKey: false });
    Object.defineProperty(atDocument, "target", { value: element });
    document.dispatchEvent(atDocument);
  });
  field.fire("keydown", { key: "Delete" });
  panel.fire("keydown", { key: "ArrowUp" });
  assert.deepEqual(done, []);
  panel.fire("keydown", { key: "K" });
  assert.deepEqual(done, ["key k"]);
});

test("with nothing selected, plus and minus zoom the photo", () => {
  for (const name of ["+", "=", "-"]) assert.equal(key(name).defaultPrevented, true);
  assert.deepEqual(done, ["zoom 1", "zoom 1", "zoom -1"]);
});

test("Escape closes a menu before anything else", () => {
  page.selectedId = 1;
  const menu = { removeAttribute: (name) => done.push(name) };
  document.querySelectorAll = () => [menu];
  key("Escape");
  assert.deepEqual([done, page.selectedId], [["open"], 1]);
});

test("sizes keep the way they were entered, with four digits, and have limits", () => {
  const object = { id: 4, size: { scale: 0.123456 }, size_m: [0.2, 0.1, 0.1] };
  assert.deepEqual(scaled(object, 2), { do: "size", object: 4, size: { scale: 0.2469 } });
  // From 5 mm to 20 m along the longest side.
  assert.deepEqual(scaled(object, 1e6).size, { scale: 12.35 });
  assert.deepEqual(scaled(object, 1e-6).size, { scale: 0.003086 });
  // What is larger already may stay so.
  assert.deepEqual(scaled({ ...object, size_m: [30, 1, 1] }, 2).size, { scale: 0.1235 });
});

test("positions below the floor are raised to it", () => {
  assert.deepEqual(aboveFloor([1, -2, -3], [0, 1, 0], -1.5), [1, -1.5, -3]);
  assert.deepEqual(aboveFloor([1, -1, -3], [0, 1, 0], -1.5), [1, -1, -3]);
});
