import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { PhotoView } from "../photo_view.js";
import { assertNear } from "./support/scene.js";

let view;

beforeEach(() => {
  view = new PhotoView();
  view.resize({ width: 1000, height: 500 }, { width: 500, height: 400 });
});

const shown = () => {
  const { scale, left, top, width, height, origin } = view.shown();
  return [scale, left, top, width, height, ...origin];
};

test("at first the whole photo is shown in the middle of the stage", () => {
  assertNear(shown(), [0.5, 0, 75, 500, 250, 0, 0]);
});

test("zooming keeps the position under the pointer", () => {
  const before = view.photoPosition([400, 150]);
  view.zoomAt(4, [400, 150]);
  assertNear(view.photoPosition([400, 150]), before);
  assertNear([view.shown().scale], [2]);
  view.zoomAt(0.25, [400, 150]);
  assertNear(shown(), [0.5, 0, 75, 500, 250, 0, 0]);
});

test("the photo fills the stage as far as it can, and cannot be moved out of it", () => {
  // Twice as large it is 1000 × 500: larger than the stage in both directions.
  view.zoomTo(2);
  view.pan(1e4, 1e4);
  assertNear(shown(), [1, 0, 0, 500, 400, 0, 0]);
  view.pan(-1e4, -1e4);
  assertNear(shown(), [1, 0, 0, 500, 400, 500, 100]);
  // A bit larger, it still has margins above and below.
  view.zoomTo(1.2);
  view.pan(-1e4, 50);
  assertNear(shown(), [0.6, 0, 50, 500, 300, 1000 - 500 / 0.6, 0], 1e-9);
});

test("panning follows the pointer", () => {
  view.zoomAt(8, [250, 200]);
  const before = view.photoPosition([100, 100]);
  view.pan(30, -20);
  assertNear(view.photoPosition([130, 80]), before);
});

test("zoom ends at the whole photo and at single pixels", () => {
  view.zoomAt(0.1, [250, 200]);
  assert.equal(view.zoom, 1);
  view.zoomAt(1e6, [250, 200]);
  assertNear([view.shown().scale], [24]);
});

test("another photo is shown whole, another stage keeps the zoom", () => {
  view.zoomTo(3);
  view.resize({ width: 1000, height: 500 }, { width: 800, height: 400 });
  assert.equal(view.zoom, 3);
  view.resize({ width: 640, height: 480 }, { width: 800, height: 400 });
  assert.equal(view.zoom, 1);
  assertNear(shown(), [400 / 480, (800 - (640 * 400) / 480) / 2, 0, (640 * 400) / 480, 400, 0, 0]);
});
