import assert from "node:assert/strict";
import { afterEach, beforeEach, mock, test } from "node:test";

import { drawEnds, measurePanel } from "../measure.js";
import { FakeCanvas } from "./support/canvas.js";
import { installDocument } from "./support/dom.js";

let page;
let panel;
let sent;
/** Elements of the panel, by id. */
let find;

afterEach(() => mock.timers.reset());
beforeEach(() => {
  // Of messages, which vanish after a while.
  mock.timers.enable({ apis: ["setTimeout"] });
  const { byId } = installDocument();
  sent = [];
  page = {
    picking: null, view: { known_length: null, room_scale: 1 },
    openView: () => page.view, send: (message) => sent.push(message), redraw() {},
  };
  document.getElementById("view-photo").click = () => {};
  document.getElementById("panel-room");
  panel = measurePanel(page);
  const all = (element) => [element, ...element.children.flatMap((child) => (child.children ? all(child) : []))];
  find = (id) => all(byId.room).find((element) => element.id === id);
  const [, form] = byId.room.children;
  find("known-length").select = () => {};
  find.form = form;
});

const ENDS = [[10.5, 20.5], [30.5, 90.5]];
const pick = () => {
  find("measure").onclick();
  ENDS.forEach((pixel) => page.picking(pixel));
};

test("two clicked points are measured, and a typed length scales the room", () => {
  pick();
  assert.equal(page.picking, null);
  assert.deepEqual(sent, [{ type: "measure", ends: ENDS }]);
  panel.take({ ends: [[0, 0], [1, 1]], length_m: 9 });
  assert.equal(find.form.hidden, true, "another page's measurement");
  panel.take({ ends: ENDS, length_m: 0.7304 });
  assert.deepEqual([find.form.hidden, find("known-length").value], [false, "0.73"]);
  find("known-length").value = "2.01";
  find.form.onsubmit({ preventDefault() {} });
  assert.deepEqual(sent[1], { type: "command", command: { do: "known-length", known: { ends: ENDS, length_m: 2.01 } } });
  assert.equal(find.form.hidden, true);
});

test("the picking is cancelled by Esc, by its button, and where there is no depth", () => {
  find("measure").onclick();
  page.picking([1, 2]);
  page.picking(null);
  assert.deepEqual([page.picking, find("measure").getAttribute("aria-pressed")], [null, "false"]);
  find("measure").onclick();
  find("measure").onclick();
  assert.equal(page.picking, null);
  assert.deepEqual(sent, []);
  pick();
  panel.take({ ends: ENDS, length_m: null });
  assert.equal(find.form.hidden, true);
  find.form.onsubmit({ preventDefault() {} });
  assert.equal(sent.length, 1);
});

test("the scale of the room is told, and can be restored", () => {
  panel.show();
  assert.equal(find("restore-scale").hidden, true);
  page.view = { known_length: { ends: ENDS, length_m: 2.01 }, room_scale: 1.25 };
  panel.show();
  assert.ok(find("scale-note").textContent.startsWith("2.01 m between two points: the room is 1.25 ×"));
  find("restore-scale").onclick();
  assert.deepEqual(sent, [{ type: "command", command: { do: "known-length", known: null } }]);
  const { context } = new FakeCanvas(100, 100);
  panel.draw(context, 2, 16);
  assert.deepEqual(context.of("fillText")[0].slice(0, 3), ["2.01 m", 20.5 * 2 + 0.6 * 16, 55.5 * 2]);
});

test("one end alone is a cross", () => {
  const { context } = new FakeCanvas(100, 100);
  drawEnds(context, 2, 16, [[10, 20]], "#fff", "1 m");
  assert.deepEqual(context.of("fillText"), []);
  assert.ok(context.of("lineTo").some(([x, y]) => x === 28 && y === 40));
});
