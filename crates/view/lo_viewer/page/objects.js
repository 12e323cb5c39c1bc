// The panel of objects: adding objects, the list, and the properties of the selected one.

import { add, dot, times } from "./camera.js";
import { around, byId, element, fill, hexFromLinear, linearFromHex, short } from "./dom.js";
import { aboveFloor } from "./gestures.js";
import { heightAboveFloor } from "./handles.js";
import { levelAxes } from "./orbit.js";
import { together } from "./selection.js";

/** @import { Align, Command, ObjectMaterial, ObjectView } from "./protocol.d.ts" */
/** @import { NewObject, Page } from "./store.js" */

/** @type {Align[]} */
const ALIGNS = ["gravity", "surface", "none"];

/** @type {[string, NewObject][]} */
const NEW = [
  ["Matte sphere", { mesh: "builtin:sphere", material: { preset: "matte-white" } }],
  ["Chrome sphere", { mesh: "builtin:sphere", material: { preset: "chrome" } }],
  ["Gold sphere", { mesh: "builtin:sphere", material: { preset: "gold" } }],
  ["Suzanne", { mesh: "builtin:suzanne", material: { preset: "glossy-white" } }],
  ["Tea set", { mesh: "builtin:tea-set" }],
  ["Glass sphere", { mesh: "builtin:glass-sphere" }],
  ["Wine glass", { mesh: "builtin:wine-glass" }],
  ["Bottle", { mesh: "builtin:bottle" }],
];

/**
 * Builds the panel. Returns a function that updates it.
 *
 * @param {Page} page
 */
export function objectsPanel(page) {
  /** @param {Command} command */
  const act = (command) => page.send({ type: "command", command });
  for (const [text, what] of NEW) {
    const button = element("button", { textContent: text, draggable: true, onclick: (/** @type {MouseEvent} */ event) => {
      act({ do: "add", ...what });
      // After a click, the keys apply to the photo.
      if (event.detail) byId("stage").focus();
    } });
    button.addEventListener("dragstart", (event) => {
      page.dragged = what;
      event.dataTransfer?.setData("text/plain", text);
    });
    button.addEventListener("dragend", () => { page.dragged = null; });
    byId("add").append(button);
  }
  byId("add").append(element("button", { textContent: "File…", title: "GLB, glTF, OBJ, PLY or STL", onclick: page.pickFile }));

  const list = byId("objects");
  list.addEventListener("keydown", (event) => {
    const item = around(event, "li");
    if (!item || around(event, "button")) return;
    if (event.key === "Enter" || event.key === " ") page.select(Number(item.dataset.id), event.shiftKey);
    else if (event.key === "ArrowDown" || event.key === "ArrowUp") {
      const next = event.key === "ArrowDown" ? item.nextElementSibling : item.previousElementSibling;
      if (next instanceof HTMLElement) {
        page.select(Number(next.dataset.id));
        focusItem(next.dataset.id);
      }
    } else return;
    event.preventDefault();
    event.stopPropagation();
  });

  /** @param {string | undefined} id */
  const focusItem = (id) => {
    const item = list.querySelector(`[data-id="${id}"]`);
    if (item instanceof HTMLElement) item.focus();
  };

  const show = propertiesOf(page, act);
  return () => {
    const items = page.openView().objects.map((object) => {
      const { id, name, is_hidden, is_locked } = object;
      /** @type {(text: string, label: string, isOn: boolean, command: Command) => HTMLButtonElement} */
      const toggle = (text, label, isOn, command) => element("button", {
        type: "button",
        className: "toggle",
        textContent: text,
        "aria-label": label,
        "aria-pressed": String(isOn),
        onclick: (/** @type {MouseEvent} */ event) => {
          event.stopPropagation();
          act(command);
        },
      });
      return element("li", {
        role: "option",
        tabIndex: 0,
        className: is_hidden ? "hidden" : "",
        "aria-selected": String(page.isSelected(id)),
        "data-id": String(id),
        onclick: (/** @type {MouseEvent} */ event) => page.select(id, event.shiftKey || event.ctrlKey || event.metaKey),
      },
      element("span", { className: "name", textContent: name }),
      toggle(is_hidden ? "Hidden" : "Hide", `Hide ${name}`, is_hidden, { do: "show", object: id, is_shown: is_hidden }),
      toggle(is_locked ? "Locked" : "Lock", `Lock ${name}`, is_locked, { do: "lock", object: id, is_locked: !is_locked }));
    });
    const focused = document.activeElement?.closest("#objects li");
    const focusedId = focused?.getAttribute("data-id") ?? undefined;
    // Of a row, the button that has the focus keeps it.
    const focusedButton = [...focused?.querySelectorAll("button") ?? []].findIndex((button) => button === document.activeElement);
    list.replaceChildren(...items);
    if (focusedId) {
      focusItem(focusedId);
      if (focusedButton >= 0) list.querySelectorAll(`[data-id="${focusedId}"] button`).forEach((button, i) => {
        if (i === focusedButton && button instanceof HTMLElement) button.focus();
      });
    }
    show(page.selected());
  };
}

/**
 * Builds the properties. Returns a function that shows those of an object.
 *
 * @param {Page} page
 * @param {(command: Command) => void} act
 */
function propertiesOf(page, act) {
  const form = byId("properties");
  form.onsubmit = (event) => event.preventDefault();
  /** @type {(label: string, step: number, extra?: Record<string, number>) => HTMLInputElement} */
  const number = (label, step, extra = {}) => element("input", { type: "number", step, "aria-label": label, ...extra });
  /**
   * @template {HTMLElement[]} Controls
   * @param {string} text
   * @param {Controls} controls
   */
  const field = (text, ...controls) => {
    const label = element("label", { textContent: text });
    if (controls.length === 1) {
      controls[0].id ||= `property-${text.toLowerCase()}`;
      label.htmlFor = controls[0].id;
    }
    form.append(label, controls.length === 1 ? controls[0] : element("div", { className: "row" }, ...controls));
    return controls;
  };
  /** @param {string} label */
  const share = (label) => element("input", { type: "range", min: 0, max: 1, step: 0.01, "aria-label": label });
  /** @param {[string, string][]} options */
  const select = (options) => element("select", {}, ...options.map(([value, text]) => element("option", { value, textContent: text })));

  const [name] = field("Name", element("input", { type: "text", maxLength: 100 }));
  // In the axes of the arrows: from the camera to the right and ahead, and from the floor up.
  const right = number("To the right of the camera, metres", 0.01, { min: -50, max: 50 });
  const ahead = number("Ahead of the camera, metres", 0.01, { min: -50, max: 50 });
  const above = number("Above the floor, metres", 0.01, { min: 0, max: 50 });
  field("Right, ahead", right, ahead);
  field("Above floor", above);
  const [turn] = field("Rotation, °", number("Rotation in degrees", 1));
  const realSize = element("button", { type: "button", textContent: "Real size" });
  const [size] = field("Height, m", number("Height in metres", 0.01, { min: 0.001, max: 20 }), realSize);
  const [align] = field("Align", select([["gravity", "with gravity"], ["surface", "with the surface"], ["none", "with the image"]]));
  const [preset] = field("Material", select([["", "of the mesh"]]));
  const [color] = field("Colour", element("input", { type: "color" }));
  const [roughness, roughnessNumber] = field("Roughness", share("Roughness"), number("Roughness", 0.01, { min: 0, max: 1 }));
  const [metallic, metallicNumber] = field("Metalness", share("Metalness"), number("Metalness", 0.01, { min: 0, max: 1 }));
  const [gloss, glossNumber] = field("Floor gloss", share("Gloss of the floor"), number("Gloss of the floor", 0.01, { min: 0, max: 1 }));
  /** @type {(text: string, title: string, onclick: () => void) => HTMLButtonElement} */
  const button = (text, title, onclick) => element("button", { type: "button", textContent: text, title, onclick });
  /** @type {(action: (object: ObjectView) => void) => () => void} */
  const withSelected = (action) => () => {
    const object = page.selected();
    if (object) action(object);
  };
  /** @type {(command: (object: number) => Command) => () => void} */
  const withGroup = (command) => () => {
    const all = together(page.group().map(({ id }) => command(id)));
    if (all) act(all);
  };
  form.append(element("div", { className: "buttons" },
    button("Put down", "Let it fall onto the surface below (G)", withGroup((object) => ({ do: "put-down", object }))),
    button("Duplicate", "Ctrl+D", withGroup((object) => ({ do: "duplicate", object }))),
    button("Delete", "Delete", withGroup((object) => ({ do: "delete", object })))));

  /** @type {(control: HTMLElement, kind: "change" | "input", action: (object: ObjectView) => Command | null) => void} */
  const on = (control, kind, action) => control.addEventListener(kind, () => {
    const object = page.selected();
    const command = object && action(object);
    if (command) (kind === "input" ? page.preview : act)(command);
  });
  /** @param {HTMLInputElement} control */
  const finite = (control) => (control.value !== "" && Number.isFinite(control.valueAsNumber) ? control.valueAsNumber : null);
  /** @type {(control: HTMLInputElement, action: (object: ObjectView, value: number) => Command | null) => void} */
  const onNumber = (control, action) => on(control, "change", (object) => {
    const value = finite(control);
    return value === null ? null : action(object, value);
  });
  on(name, "change", ({ id }) => (name.value.trim() ? { do: "rename", object: id, name: name.value.trim() } : null));
  for (const control of [right, ahead, above]) {
    on(control, "change", ({ id }) => {
      const [toRight, toAhead, height] = [right, ahead, above].map((field) => (field.validity.valid ? finite(field) : null));
      if (toRight === null || toAhead === null || height === null) return null;
      const { up, extent } = page.openScene();
      const level = levelAxes(up);
      const flat = add(times(level.right, toRight), times(level.ahead, toAhead));
      const position = aboveFloor(add(flat, times(up, extent.floor_m + height)), up, extent.floor_m);
      return { do: "place", object: id, place: { position } };
    });
  }
  realSize.onclick = withSelected(({ id, metres_per_unit }) => act({ do: "size", object: id, size: { scale: metres_per_unit } }));
  onNumber(turn, ({ id }, yaw_deg) => ({ do: "turn", object: id, yaw_deg }));
  onNumber(size, ({ id }, height) => (height > 0 && height <= 20 ? { do: "size", object: id, size: { height } } : null));
  on(align, "change", ({ id }) => {
    const chosen = ALIGNS.find((each) => each === align.value);
    return chosen ? { do: "align", object: id, align: chosen } : null;
  });
  on(preset, "change", ({ id }) => ({ do: "material", object: id, material: preset.value ? { preset: preset.value } : null }));

  // A slider previews while it moves, and is one step of the history.
  /** @type {(control: HTMLInputElement, action: (object: ObjectView) => Command) => void} */
  const slide = (control, action) => {
    on(control, "input", action);
    control.addEventListener("change", () => page.send({ type: "commit" }));
  };
  /** @type {(object: ObjectView, change: ObjectMaterial) => Command} */
  const changed = (object, change) => ({ do: "material", object: object.id, material: { ...object.material, ...change } });
  slide(color, (object) => changed(object, { base_color: linearFromHex(color.value) }));
  slide(roughness, (object) => changed(object, { roughness: roughness.valueAsNumber }));
  slide(metallic, (object) => changed(object, { metallic: metallic.valueAsNumber }));
  slide(gloss, () => ({ do: "floor-gloss", gloss: gloss.valueAsNumber }));
  onNumber(roughnessNumber, (object, value) => changed(object, { roughness: value }));
  onNumber(metallicNumber, (object, value) => changed(object, { metallic: value }));
  onNumber(glossNumber, (_, value) => ({ do: "floor-gloss", gloss: value }));

  return (/** @type {ObjectView | null} */ object) => {
    form.hidden = !object;
    byId("properties-empty").hidden = object !== null;
    const count = page.group().length;
    byId("properties-group").hidden = !object || count < 2;
    byId("properties-group").textContent = `${count} objects are selected. Handles, keys and buttons change all of them; the fields change “${object?.name}”.`;
    if (!object) return;
    if (preset.options.length === 1) {
      preset.append(...page.materials.map(({ name: known }) => element("option", { value: known, textContent: known })));
    }
    fill(name, object.name);
    const { up, extent } = page.openScene();
    const level = levelAxes(up);
    fill(right, short(dot(object.position_m, level.right)));
    fill(ahead, short(dot(object.position_m, level.ahead)));
    fill(above, short(heightAboveFloor(object.position_m, up, extent.floor_m)));
    realSize.hidden = !hasOtherRealSize(object);
    realSize.title = `${short((object.size_m[1] * object.metres_per_unit) / object.scale)} m: one unit of the mesh is ${short(object.metres_per_unit)} m`;
    fill(turn, short(object.yaw_deg));
    fill(size, short(object.size_m[1]));
    fill(align, object.align);
    const material = object.material ?? {};
    const known = page.materials.find(({ name: other }) => other === material.preset);
    fill(preset, material.preset ?? "");
    const shown = { base_color: [1, 1, 1], roughness: 0.5, metallic: 0, ...known, ...material };
    // The page does not know the mesh's own material.
    for (const control of [color, roughness, roughnessNumber, metallic, metallicNumber]) control.disabled = !object.material;
    fill(color, hexFromLinear(shown.base_color));
    for (const control of [roughness, roughnessNumber]) fill(control, short(shown.roughness));
    for (const control of [metallic, metallicNumber]) fill(control, short(shown.metallic));
    for (const control of [gloss, glossNumber]) fill(control, short(page.openView().floor_gloss));
  };
}

/**
 * Returns whether an object has another size than its file gives it.
 *
 * @param {Pick<ObjectView, "scale" | "metres_per_unit" | "mesh">} object
 */
function hasOtherRealSize({ scale, metres_per_unit, mesh }) {
  return mesh !== "builtin:suzanne" && Math.abs(scale / metres_per_unit - 1) > 1e-3;
}

/**
 * Describes the first size of a dropped mesh and its unit; "" for what is as its file says.
 *
 * @param {ObjectView} object
 */
export function sizeNote(object) {
  const { mesh, size_m, scale, metres_per_unit, unit, unit_is_stated } = object;
  if (mesh.startsWith("builtin:")) return "";
  const height = (/** @type {number} */ metres) => `${short(Math.round(1000 * metres) / 1000)} m high`;
  if (hasOtherRealSize(object)) {
    const real = height((size_m[1] * metres_per_unit) / scale);
    const why = unit_is_stated ? `it is ${real} by its file` : `its file states no unit; in ${unit} it would be ${real}`;
    return `${mesh} is ${height(size_m[1])} at first: ${why}. “Real size” in its fields restores that.`;
  }
  return unit_is_stated ? "" : `${mesh} is ${height(size_m[1])}: its file states no unit, ${unit} are assumed. Change its height if that is wrong.`;
}
