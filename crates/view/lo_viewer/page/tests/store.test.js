import assert from "node:assert/strict";
import { afterEach, test } from "node:test";

import { page } from "../store.js";
import { CUBE, SCENE } from "./support/scene.js";

afterEach(() => Object.assign(page, { scene: null, view: null, selectedId: null }));

test("the selected object is looked up in the newest state", () => {
  assert.equal(page.selected(), null);
  page.selectedId = 1;
  assert.equal(page.selected(), null);
  page.view = { objects: [{ ...CUBE, id: 2 }, CUBE] };
  assert.equal(page.selected(), CUBE);
  page.view = { objects: [] };
  assert.equal(page.selected(), null);
});

test("scene and session are errors where there are none", () => {
  assert.equal(page.isOpen(), false);
  assert.throws(page.openScene, /no scene/);
  assert.throws(page.openView, /no session/);
  page.scene = SCENE;
  assert.equal(page.openScene(), SCENE);
  assert.equal(page.isOpen(), true);
});

test("parts cannot add fields", () => {
  assert.throws(() => { page.scen = SCENE; }, TypeError);
});
