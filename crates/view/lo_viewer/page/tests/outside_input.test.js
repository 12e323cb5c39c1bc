import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { listenOutside } from "../outside_input.js";
import { FakeElement, installDocument } from "./support/dom.js";
import { assertNear } from "./support/scene.js";

let canvas;
let done;
let isActive;
/** What a press starts to drag; null for the view. */
let grabbed;

beforeEach(() => {
  grabbed = null;
  installDocument();
  [canvas, done, isActive] = [new FakeElement("canvas"), [], true];
  const note = (name) => (...args) => done.push([name, ...args.filter((arg) => typeof arg === "number")]);
  const actions = Object.fromEntries(["rotate", "pan", "zoom", "resetView", "centre", "click"].map((name) => [name, note(name)]));
  listenOutside(new FakeElement(), canvas, () => isActive, { ...actions, grab: () => grabbed });
});

const pointer = (kind, [clientX, clientY], more = {}) => canvas.fire(kind, { clientX, clientY, button: 0, shiftKey: false, ...more });
const key = (name, more = {}) => document.fire("keydown", { key: name, ctrlKey: false, metaKey: false, altKey: false, shiftKey: false, ...more });

test("a drag over the height rotates by 200°, with Shift it pans by the height", () => {
  pointer("pointerdown", [0, 0]);
  pointer("pointermove", [0, 100]);
  pointer("pointerup", [0, 100]);
  pointer("pointermove", [50, 50]);
  pointer("pointerdown", [0, 0], { shiftKey: true });
  pointer("pointermove", [50, 100]);
  pointer("pointerup", [50, 100]);
  assert.deepEqual(done, [["rotate", -0, 200], ["pan", -0.5, 1]]);
});

test("a press that hardly moves is a click; a cancelled one and a pan are not", () => {
  pointer("pointerdown", [0, 0]);
  pointer("pointermove", [2, 1]);
  pointer("pointerup", [2, 1]);
  assert.equal(done.at(-1)[0], "click");
  done.length = 0;
  pointer("pointerdown", [0, 0]);
  pointer("pointercancel", [0, 0]);
  pointer("pointerdown", [0, 0], { button: 2 });
  pointer("pointerup", [0, 0], { button: 2 });
  assert.deepEqual(done, []);
});

test("the wheel zooms, there and back to the same distance", () => {
  for (const deltaY of [120, -120, 1e6]) canvas.fire("wheel", { deltaY });
  assertNear([done[0][1] * done[1][1]], [1]);
  assert.ok(done[0][1] > 1);
  assertNear([done[2][1]], [Math.exp(300 / 700)]);
});

test("keys act while the view is shown", () => {
  for (const [name, more] of [["ArrowLeft"], ["ArrowLeft", { shiftKey: true }], ["C"], ["Home"], ["z", { ctrlKey: true }], ["x"]]) key(name, more);
  assert.deepEqual(done, [["rotate", -5, 0], ["pan", -0.05, 0], ["centre"], ["resetView"]]);
  canvas.hidden = true;
  key("Home");
  isActive = false;
  canvas.hidden = false;
  key("Home");
  pointer("dblclick", [0, 0]);
  assert.equal(done.length, 4);
});

test("a drag that begins on a light moves it instead of the view, and Escape cancels it", () => {
  grabbed = { move: ({ clientX }) => done.push(["move", clientX]), end: (isKept) => done.push(["end", isKept]) };
  pointer("pointerdown", [0, 0]);
  pointer("pointermove", [0, 100]);
  pointer("pointermove", [50, 50]);
  pointer("pointerup", [50, 50]);
  pointer("pointermove", [80, 80]);
  assert.deepEqual(done, [["move", 0], ["move", 50], ["end", true]]);
  done.length = 0;
  pointer("pointerdown", [0, 0]);
  pointer("pointermove", [10, 0]);
  key("Escape");
  pointer("pointerup", [10, 0]);
  assert.deepEqual(done, [["move", 10], ["end", false]]);
  pointer("pointerdown", [0, 0], { button: 2 });
  pointer("pointermove", [0, 50]);
  assert.equal(done.at(-1)[0], "pan");
});
