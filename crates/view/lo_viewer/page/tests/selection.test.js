import assert from "node:assert/strict";
import { test } from "node:test";

import { existing, selecting, selectionAfter, together } from "../selection.js";

test("a click selects an object alone, with Shift it is added or taken away", () => {
  const one = { selectedId: 1, alsoSelected: [] };
  assert.deepEqual(selectionAfter(one, 2, false), { selectedId: 2, alsoSelected: [] });
  const two = selectionAfter(one, 2, true);
  assert.deepEqual(two, { selectedId: 2, alsoSelected: [1] });
  assert.deepEqual(selectionAfter(two, 2, true), { selectedId: 1, alsoSelected: [] });
  assert.deepEqual(selectionAfter(two, 1, true), { selectedId: 2, alsoSelected: [] });
  assert.deepEqual(selectionAfter(two, null, true), two);
  assert.deepEqual(selectionAfter(two, null, false), { selectedId: null, alsoSelected: [] });
});

test("deleted objects leave the selection", () => {
  assert.deepEqual(existing({ selectedId: 3, alsoSelected: [1, 2] }, [{ id: 2 }, { id: 4 }]), { selectedId: 2, alsoSelected: [] });
  assert.deepEqual(existing({ selectedId: null, alsoSelected: [] }, [{ id: 2 }]), { selectedId: null, alsoSelected: [] });
});

test("commands are one step; a single one stays as it is", () => {
  const commands = [1, 2].map((object) => ({ do: "delete", object }));
  assert.deepEqual(together(commands), { do: "together", commands });
  assert.deepEqual(together([null, commands[0]]), commands[0]);
  assert.equal(together([null]), null);
});

test("either objects or a light are selected", () => {
  let changes = 0;
  const page = { selectedId: null, alsoSelected: [], selectedLight: null, view: { objects: [{ id: 1 }, { id: 2 }] } };
  selecting(page, () => { changes += 1; });
  page.select(1);
  page.select(1);
  page.select(2, true);
  assert.deepEqual([page.group().length, page.isSelected(1), changes], [2, true, 2]);
  page.selectLight("L1");
  assert.deepEqual([page.selectedId, page.group(), page.selectedLight], [null, [], "L1"]);
  page.select(1);
  assert.equal(page.selectedLight, null);
});
