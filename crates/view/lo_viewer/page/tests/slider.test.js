import assert from "node:assert/strict";
import { test } from "node:test";

import { numberSlider } from "../slider.js";
import { installDocument } from "./support/dom.js";

function slider() {
  installDocument();
  const done = [];
  const page = { preview: (command) => done.push(["preview", command]), send: (message) => done.push(["send", message]) };
  const command = (factor) => ({ do: "contrast", factor });
  const made = numberSlider(page, { id: "contrast", name: "Contrast", min: 0, max: 3, step: 0.05, command });
  const [range, number] = made.root.children;
  assert.equal(range, made.range);
  return { made, range, number, done };
}

test("a movement of the slider is previewed, and one step of the history", () => {
  const { range, done } = slider();
  for (const value of ["1.5", "1.75"]) {
    range.value = value;
    range.fire("input");
  }
  range.fire("change");
  assert.deepEqual(done, [
    ["preview", { do: "contrast", factor: 1.5 }],
    ["preview", { do: "contrast", factor: 1.75 }],
    ["send", { type: "commit" }],
  ]);
});

test("a typed number is executed at once, and no number is not", () => {
  const { number, done } = slider();
  number.value = "2.25";
  number.fire("change");
  number.value = "";
  number.fire("change");
  assert.deepEqual(done, [["send", { type: "command", command: { do: "contrast", factor: 2.25 } }]]);
});

test("both controls show the value, and a refused number is replaced by it", () => {
  const { made, range, number } = slider();
  made.show(1.23456);
  assert.deepEqual([range.value, number.value], ["1.235", "1.235"]);
  number.value = "99";
  number.fire("blur");
  assert.equal(number.value, "1.235");
  made.enable(false);
  assert.ok(range.disabled && number.disabled);
});
