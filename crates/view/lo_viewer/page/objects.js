// The panel of objects: adding objects, the list, and the properties of the selected one.

import { project } from "./camera.js";
import { around, byId, element, fill, hexFromLinear, linearFromHex, short, showMessage } from "./dom.js";
import { putDown } from "./gestures.js";

/** @import { Align, Command, ObjectMaterial, ObjectView } from "./protocol.d.ts" */
/** @import { Page } from "./store.js" */

/** @type {Align[]} */
const ALIGNS = ["gravity", "surface", "none"];

/** @type {[string, { mesh: string, material?: ObjectMaterial }][]} */
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
    byId("add").append(element("button", { textContent: text, onclick: (/** @type {MouseEvent} */ event) => {
      act({ do: "add", ...what });
      // After a click, the keys apply to the photo.
      if (event.detail) byId("stage").focus();
    } }));
  }
  byId("add").append(element("button", { textContent: "File…", title: "GLB, glTF, OBJ, PLY or STL", onclick: page.pickFile }));

  const list = byId("objects");
  list.addEventListener("keydown", (event) => {
    const item = around(event, "li");
    if (!item) return;
    if (event.key === "Enter" || event.key === " ") page.select(Number(item.dataset.id));
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
    const items = page.openView().objects.map((object) => element("li", {
      role: "option",
      tabIndex: 0,
      textContent: object.name,
      "aria-selected": String(object.id === page.selectedId),
      "data-id": String(object.id),
      onclick: () => page.select(object.id),
    }));
    const focused = document.activeElement?.closest("#objects li")?.getAttribute("data-id");
    list.replaceChildren(...items);
    if (focused) focusItem(focused);
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
  const position = field("Position, m", number("x", 0.01), number("y", 0.01), number("z", 0.01));
  const [turn] = field("Rotation, °", number("Rotation in degrees", 1));
  const [size] = field("Height, m", number("Height in metres", 0.01, { min: 0.001 }));
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
  form.append(element("div", { className: "buttons" },
    button("Put down", "Put it on the surface seen there (G)", withSelected((object) => {
      const base = project(page.openScene().camera, object.position_m);
      if (base) act(putDown(object, base));
      else showMessage("the object is behind the camera", true);
    })),
    button("Duplicate", "Ctrl+D", withSelected(({ id }) => act({ do: "duplicate", object: id }))),
    button("Delete", "Delete", withSelected(({ id }) => act({ do: "delete", object: id })))));

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
  for (const control of position) {
    on(control, "change", ({ id }) => {
      const [x, y, z] = position.map(finite);
      return x === null || y === null || z === null ? null : { do: "place", object: id, place: { position: [x, y, z] } };
    });
  }
  onNumber(turn, ({ id }, yaw_deg) => ({ do: "turn", object: id, yaw_deg }));
  onNumber(size, ({ id }, height) => (height > 0 ? { do: "size", object: id, size: { height } } : null));
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
    if (!object) return;
    if (preset.options.length === 1) {
      preset.append(...page.materials.map(({ name: known }) => element("option", { value: known, textContent: known })));
    }
    fill(name, object.name);
    object.position_m.forEach((value, i) => fill(position[i], short(value)));
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
