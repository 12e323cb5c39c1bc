import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";

import { probePanel } from "../probe.js";
import { FakeCanvas, installCanvas } from "./support/canvas.js";
import { installDocument } from "./support/dom.js";

let probe;
let sent;

beforeEach(() => {
  installCanvas();
  const document = installDocument();
  const create = document.createElement;
  document.createElement = (tag) => {
    const made = create(tag);
    if (tag === "canvas") made.getContext = FakeCanvas.prototype.getContext.bind({ context: { drawImage() {} } });
    return made;
  };
  sent = [];
  mock.timers.reset();
  mock.timers.enable({ apis: ["setTimeout"] });
  probe = probePanel({ exposure: 1.5, send: (message) => sent.push(message) });
});

const answer = (at_m) => probe.take({ type: "probe", pixel: [0, 0], at_m, lengths: [1, 1, 1] }, ["a", "b", "c"]);

test("one request is pending, and then the newest position is requested", async () => {
  probe.at([1, 1]);
  probe.at([2, 2]);
  probe.at([3, 3]);
  assert.deepEqual(sent, [{ type: "probe", pixel: [1, 1], lift_m: 0.1, exposure_ev: 1.5 }]);
  await answer([0, 0, -1]);
  assert.deepEqual(sent.map(({ pixel }) => pixel), [[1, 1], [3, 3]]);
  assert.deepEqual(probe.shown_m, [0, 0, -1]);
  await answer([0, 0, -2]);
  assert.equal(sent.length, 2);
});

test("a held probe does not follow the pointer", () => {
  probe.at([1, 1]);
  probe.hold();
  mock.timers.tick(3000);
  probe.at([2, 2]);
  assert.equal(sent.length, 1);
  assert.equal(probe.query(), "?u=1&v=1&lift=0.1");
  probe.again();
  assert.deepEqual(sent.map(({ pixel }) => pixel), [[1, 1], [1, 1]]);
});

test("without depth there is no point", async () => {
  probe.at([1, 1]);
  await answer([0, 0, -1]);
  await probe.take({ type: "no-probe" }, []);
  assert.equal(probe.shown_m, null);
});

test("a lost response is given up after three seconds", () => {
  probe.at([1, 1]);
  probe.at([2, 2]);
  mock.timers.tick(2999);
  assert.equal(sent.length, 1);
  mock.timers.tick(1);
  assert.deepEqual(sent[1].pixel, [2, 2]);
});
