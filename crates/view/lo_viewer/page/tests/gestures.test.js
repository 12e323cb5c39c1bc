import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { project } from "../camera.js";
import { listen, putDown, scaled } from "../gestures.js";
import { handlesOf } from "../handles.js";
import { FakeElement, installDocument } from "./support/dom.js";
import { CAMERA, CUBE, SCENE, assertNear } from "./support/scene.js";

const FIELD = "input:not([type=range]):not([type=checkbox]), select, dialog[open]";
const PANEL = "aside, header, footer, #timeline";
const BASE = project(CAMERA, CUBE.position_m);

let stage;
let page;
/** Previewed commands and sent messages, in order. */
let done;

beforeEach(() => {
  installDocument();
  done = [];
  stage = new FakeElement();
  page = {
    scene: SCENE, view: { objects: [CUBE] }, selectedId: null, hovered: null, picking: null,
    keys: { k: () => done.push("key k") },
    openScene: () => SCENE,
    selected: () => page.view.objects.find(({ id }) => id === page.selectedId) ?? null,
    select: (id) => { page.selectedId = id; },
    photoPosition: ({ at }) => at,
    reach: () => 8,
    hover() {},
    redraw() {},
    preview: (command) => done.push(command),
    send: (message) => done.push(message),
  };
  listen(stage, page);
});

const press = (at) => stage.fire("pointerdown", { button: 0, at });
const moveTo = (at) => stage.fire("pointermove", { at });
const key = (name, more = {}) => document.fire("keydown", { key: name, ctrlKey: false, metaKey: false, shiftKey: false, ...more });

test("a drag previews positions of the base, and commits at the end", () => {
  // Pressed on the object's side, 20 pixels above the base.
  press([BASE[0] + 5, BASE[1] - 20]);
  assert.equal(page.selectedId, 1);
  assert.deepEqual([page.gesture().handle, page.gesture().object], ["move", 1]);
  moveTo([BASE[0] + 35, BASE[1] - 10]);
  stage.fire("pointerup");
  assert.deepEqual(done, [{ do: "drag", object: 1, to: [BASE[0] + 30, BASE[1] + 10] }, { type: "commit" }]);
  assert.equal(page.gesture(), null);
});

test("Escape cancels a drag, and nothing is committed after it", () => {
  press([BASE[0], BASE[1] - 20]);
  moveTo([BASE[0] + 30, BASE[1]]);
  key("Escape");
  stage.fire("pointerup");
  assert.deepEqual(done.slice(1), [{ type: "cancel" }]);
  assert.equal(page.selectedId, 1, "the next Escape clears the selection");
  key("Escape");
  assert.equal(page.selectedId, null);
});

test("a click without a movement is not a step of the history", () => {
  press([BASE[0], BASE[1] - 20]);
  stage.fire("pointerup");
  press([5, 5]);
  assert.deepEqual(done, []);
  assert.equal(page.selectedId, null, "beside the object");
});

test("the nearer of two objects is selected", () => {
  page.view.objects = [{ ...CUBE, id: 2, position_m: [0, -0.75, -3], size_m: [0.75, 0.75, 0.75] }, CUBE];
  press([BASE[0], BASE[1] - 20]);
  assert.equal(page.selectedId, 1);
});

test("the ring turns by the angle around the base, seen from above", () => {
  page.selectedId = 1;
  const { ring } = handlesOf(CAMERA, CUBE);
  press(ring[0]);
  assert.equal(page.gesture().handle, "turn");
  // A quarter of the ring, to +X.
  moveTo(ring[12]);
  assert.deepEqual(done, [{ do: "turn", object: 1, yaw_deg: 90 }]);
});

test("an animated object may turn by more than half a turn, another one is wrapped", () => {
  for (const [path, expected] of [[null, -100], [{ interpolation: "linear", keyframes: [] }, 260]]) {
    done.length = 0;
    page.view.objects = [{ ...CUBE, yaw_deg: 170, path }];
    page.selectedId = 1;
    const { ring } = handlesOf(CAMERA, page.view.objects[0]);
    press(ring[0]);
    moveTo(ring[12]);
    stage.fire("pointercancel");
    assert.deepEqual(done, [{ do: "turn", object: 1, yaw_deg: expected }, { type: "cancel" }]);
  }
});

test("the arrow lifts along the up axis", () => {
  page.selectedId = 1;
  const { lift } = handlesOf(CAMERA, CUBE);
  press(lift);
  // 0.3 m at a depth of 2 m.
  moveTo([lift[0], lift[1] - (0.3 * CAMERA.fy) / 2]);
  assert.equal(done[0].do, "place");
  assertNear(done[0].place.position, [0, -0.2, -2]);
});

test("the corner scales by the distance from the base", () => {
  page.selectedId = 1;
  const { size } = handlesOf(CAMERA, CUBE);
  press(size);
  moveTo([BASE[0] + 2 * (size[0] - BASE[0]), BASE[1] + 2 * (size[1] - BASE[1])]);
  moveTo(BASE);
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
    ["g", {}, { do: "place", object: 1, place: { pixel: BASE } }],
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
  for (const name of ["ArrowLeft", "g", "[", "Delete"]) key(name);
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

test("sizes keep the way they were entered, with four digits", () => {
  assert.deepEqual(scaled({ id: 4, size: { scale: 0.123456 } }, 2), { do: "size", object: 4, size: { scale: 0.2469 } });
  assert.deepEqual(putDown({ id: 4 }, [1, 2]), { do: "place", object: 4, place: { pixel: [1, 2] } });
});
