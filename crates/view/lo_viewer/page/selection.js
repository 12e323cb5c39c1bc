// The selection: one object with handles, further ones that move with it, or a light.

/** @import { Command, ObjectView } from "./protocol.d.ts" */
/** @import { Page } from "./store.js" */

/** @typedef {{ selectedId: number | null, alsoSelected: number[] }} Selection */

/**
 * Returns the selection after a click on an object: it alone, or added to or taken from the others. `null` is a click
 * beside all objects.
 *
 * @type {(selection: Selection, id: number | null, isAdding: boolean) => Selection}
 */
export function selectionAfter({ selectedId, alsoSelected }, id, isAdding) {
  if (!isAdding) return { selectedId: id, alsoSelected: [] };
  const all = selectedId === null ? alsoSelected : [...alsoSelected, selectedId];
  if (id === null) return { selectedId, alsoSelected };
  // The last one has the handles.
  const now = all.includes(id) ? all.filter((other) => other !== id) : [...all, id];
  return { selectedId: now.at(-1) ?? null, alsoSelected: now.slice(0, -1) };
}

/**
 * Returns the selection without objects that do not exist any more.
 *
 * @type {(selection: Selection, objects: ObjectView[]) => Selection}
 */
export function existing({ selectedId, alsoSelected }, objects) {
  const all = [...alsoSelected, ...(selectedId === null ? [] : [selectedId])];
  const left = all.filter((id) => objects.some((object) => object.id === id));
  return { selectedId: left.at(-1) ?? null, alsoSelected: left.slice(0, -1) };
}

/**
 * Returns the command that executes others as one step; null without any.
 *
 * @type {(commands: (Command | null)[]) => Command | null}
 */
export function together(commands) {
  const made = commands.filter((command) => command !== null);
  return made.length > 1 ? { do: "together", commands: made } : made[0] ?? null;
}

/**
 * Lets the page select objects and lights; `shown()` is called after each change. Provides `page.select`,
 * `page.selectLight`, `page.group` and `page.isSelected`.
 *
 * @param {Page} page
 * @param {() => void} shown
 */
export function selecting(page, shown) {
  /** @type {(selection: Selection, light: string | null) => void} */
  const set = (selection, light) => {
    const isSame = String([selection.selectedId, selection.alsoSelected, light]) === String([page.selectedId, page.alsoSelected, page.selectedLight]);
    if (isSame) return;
    Object.assign(page, selection, { selectedLight: light });
    shown();
  };
  page.select = (id, isAdding = false) => {
    const selection = selectionAfter(page, id, isAdding);
    set(selection, isAdding && id === null ? page.selectedLight : null);
  };
  page.selectLight = (id) => set({ selectedId: null, alsoSelected: [] }, id);
  page.isSelected = (id) => id === page.selectedId || page.alsoSelected.includes(id);
  page.group = () => (page.view?.objects ?? []).filter(({ id }) => page.isSelected(id));
}
