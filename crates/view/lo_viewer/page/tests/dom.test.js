import assert from "node:assert/strict";
import { readFileSync, readdirSync } from "node:fs";
import { test } from "node:test";

import { coded, copyText, element, fill, hexFromLinear, linear, linearFromHex, short } from "../dom.js";
import { FakeElement, installDocument } from "./support/dom.js";
import { assertNear } from "./support/scene.js";

const FOLDER = new URL("../", import.meta.url);
const read = (name) => readFileSync(new URL(name, FOLDER), "utf8");

test("sRGB and linear values convert as IEC 61966-2-1 says", () => {
  assertNear([linear(0), linear(1), linear(0.04045), linear(0.5)], [0, 1, 0.0031308, 0.2140411], 1e-7);
  for (const value of [0, 0.001, 0.18, 0.5, 1]) assertNear([linear(coded(value))], [value], 1e-6);
});

test("colours convert to hexadecimal codes and back", () => {
  assert.equal(hexFromLinear([1, 0, 0.2158605]), "#ff0080");
  assert.equal(hexFromLinear([2, -1, 0]), "#ff0000", "clamped");
  for (const hex of ["#000000", "#ffffff", "#0a64c8"]) assert.equal(hexFromLinear(linearFromHex(hex)), hex);
});

test("text is copied over https and, by the older command, over http", async () => {
  const document = installDocument();
  const shown = Object.assign(new FakeElement("code"), { textContent: "lightoctree insert" });
  const written = [];
  const set = (clipboard) => Object.defineProperty(globalThis, "navigator", { value: { clipboard }, configurable: true });
  let selected = null;
  globalThis.getSelection = () => ({
    selectAllChildren: (element) => { selected = element; },
    removeAllRanges: () => { selected = null; },
  });
  let isAllowed = true;
  document.execCommand = (command) => {
    if (isAllowed) written.push([command, selected?.textContent]);
    return isAllowed;
  };
  set({ writeText: async (text) => written.push(["clipboard", text]) });
  assert.equal(await copyText(shown), true);
  // Browsers have no clipboard in pages over http of other machines.
  set(undefined);
  assert.equal(await copyText(shown), true);
  assert.equal(selected, null);
  set({ writeText: async () => { throw new Error("NotAllowedError"); } });
  assert.equal(await copyText(shown), true);
  assert.deepEqual(written, [["clipboard", "lightoctree insert"], ["copy", "lightoctree insert"], ["copy", "lightoctree insert"]]);
  isAllowed = false;
  assert.equal(await copyText(shown), false);
  assert.equal(selected, shown, "to be copied by hand");
});

test("numbers have at most three decimals", () => {
  assert.deepEqual([0.1 + 0.2, 2, -1.23456, 1e-9].map(short), ["0.3", "2", "-1.235", "0"]);
});

test("a field keeps what the user types in it", () => {
  const document = installDocument();
  const field = Object.assign(new FakeElement("input"), { type: "number", value: "12" });
  document.activeElement = field;
  fill(field, 3);
  assert.equal(field.value, "12");
  // A focused slider shows changes, such as those of undo.
  const slider = Object.assign(new FakeElement("input"), { type: "range", value: "12" });
  document.activeElement = slider;
  fill(slider, 3);
  fill(field, 4);
  assert.deepEqual([slider.value, field.value], ["3", "4"]);
});

test("elements get properties, attributes and children", () => {
  installDocument();
  const made = element("input", { type: "number", min: 0, "aria-label": "x", "data-id": "7" }, "text");
  assert.deepEqual([made.tag, made.type, made.min], ["input", "number", 0]);
  assert.deepEqual(made.attributes, { "aria-label": "x", "data-id": "7" });
  assert.deepEqual(made.children, ["text"]);
});

test("every element that a module looks up is in the page", () => {
  const tags = new Map([...read("index.html").matchAll(/<(\w+)[^>]*?\sid="([^"]+)"/g)].map(([, tag, id]) => [id, tag]));
  const modules = readdirSync(FOLDER).filter((name) => name.endsWith(".js"));
  const wanted = new Set(modules.flatMap((name) => [...read(name).matchAll(/\bbyId\("([^"]+)"\)/g)].map(([, id]) => id)));
  assert.ok(wanted.size > 40);
  for (const id of wanted) assert.ok(tags.has(id), id);
  // The interfaces that `dom.js` declares are those of the tags.
  const declared = [...read("dom.js").matchAll(/@property \{HTML(\w+)Element\} (\S+)/g)];
  assert.ok(declared.length > 20);
  for (const [, name, id] of declared) {
    const expected = { canvas: "Canvas", input: "Input", select: "Select", button: "Button", form: "Form", dialog: "Dialog", details: "Details", progress: "Progress" };
    assert.equal(name, expected[tags.get(id)], id);
  }
});
