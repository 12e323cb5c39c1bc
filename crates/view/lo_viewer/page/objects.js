// The panel of objects: adding objects, the list, and the properties of the selected one.

import { byId, element, fill, hexFromLinear, linearFromHex, short } from "./dom.js";
import { putDown } from "./gestures.js";

const NEW = [
  ["Matte sphere", { mesh: "builtin:sphere", material: { preset: "matte-white" } }],
  ["Chrome sphere", { mesh: "builtin:sphere", material: { preset: "chrome" } }],
  ["Gold sphere", { mesh: "builtin:sphere", material: { preset: "gold" } }],
  ["Suzanne", { mesh: "builtin:suzanne", material: { preset: "glossy-white" } }],
  ["Tea set", { mesh: "builtin:tea-set" }],
];

/** Builds the panel. Returns a function that updates it. */
export function objectsPanel(page) {
  const act = (command) => page.send({ type: "command", command });
  for (const [text, what] of NEW) {
    byId("add").append(element("button", { textContent: text, onclick: (event) => {
      act({ do: "add", ...what });
      // After a click, the keys apply to the photo.
      if (event.detail) byId("stage").focus();
    } }));
  }
  byId("add").append(element("button", { textContent: "File…", title: "GLB, glTF, OBJ, PLY or STL", onclick: page.pickFile }));

  const list = byId("objects");
  list.addEventListener("keydown", (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    const item = event.target.closest("li");
    if (!item) return;
    if (event.key === "Enter" || event.key === " ") page.select(Number(item.dataset.id));
    else if (step) {
      const next = step > 0 ? item.nextElementSibling : item.previousElementSibling;
      if (next) {
        page.select(Number(next.dataset.id));
        list.querySelector(`[data-id="${next.dataset.id}"]`)?.focus();
      }
    } else return;
    event.preventDefault();
    event.stopPropagation();
  });

  const show = propertiesOf(page, act);
  return () => {
    const items = page.view.objects.map((object) => element("li", {
      role: "option",
      tabIndex: 0,
      textContent: object.name,
      "aria-selected": String(object.id === page.selectedId),
      "data-id": String(object.id),
      onclick: () => page.select(object.id),
    }));
    const focused = document.activeElement?.closest?.("#objects li")?.dataset.id;
    list.replaceChildren(...items);
    if (focused) list.querySelector(`[data-id="${focused}"]`)?.focus();
    show(page.selected());
  };
}

function propertiesOf(page, act) {
  const form = byId("properties");
  form.onsubmit = (event) => event.preventDefault();
  const number = (label, step, extra = {}) => element("input", { type: "number", step, "aria-label": label, ...extra });
  const field = (text, ...controls) => {
    const label = element("label", { textContent: text });
    if (controls.length === 1) {
      controls[0].id ||= `property-${text.toLowerCase()}`;
      label.htmlFor = controls[0].id;
    }
    form.append(label, controls.length === 1 ? controls[0] : element("div", { className: "row" }, ...controls));
    return controls;
  };
  const share = (label) => element("input", { type: "range", min: 0, max: 1, step: 0.01, "aria-label": label });
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
  const button = (text, title, onclick) => element("button", { type: "button", textContent: text, title, onclick });
  form.append(element("div", { className: "buttons" },
    button("Put down", "Put it on the surface seen there (G)", () => act(putDown(page.scene.camera, page.selected()))),
    button("Duplicate", "Ctrl+D", () => act({ do: "duplicate", object: page.selectedId })),
    button("Delete", "Delete", () => act({ do: "delete", object: page.selectedId }))));

  const on = (control, kind, action) => control.addEventListener(kind, () => {
    const object = page.selected();
    const command = object && action(object);
    if (command) (kind === "input" ? page.preview : act)(command);
  });
  const finite = (control) => (control.value !== "" && Number.isFinite(control.valueAsNumber) ? control.valueAsNumber : null);
  on(name, "change", ({ id }) => name.value.trim() && { do: "rename", object: id, name: name.value.trim() });
  for (const control of position) {
    on(control, "change", ({ id }) => {
      const at = position.map(finite);
      return !at.includes(null) && { do: "place", object: id, place: { position: at } };
    });
  }
  on(turn, "change", ({ id }) => finite(turn) !== null && { do: "turn", object: id, yaw_deg: finite(turn) });
  on(size, "change", ({ id }) => finite(size) > 0 && { do: "size", object: id, size: { height: finite(size) } });
  on(align, "change", ({ id }) => ({ do: "align", object: id, align: align.value }));
  on(preset, "change", ({ id }) => ({ do: "material", object: id, material: preset.value ? { preset: preset.value } : null }));

  // A slider previews while it moves, and is one step of the history.
  const slide = (control, action) => {
    on(control, "input", action);
    control.addEventListener("change", () => page.send({ type: "commit" }));
  };
  const changed = (object, change) => ({ do: "material", object: object.id, material: { ...object.material, ...change } });
  slide(color, (object) => changed(object, { base_color: linearFromHex(color.value) }));
  slide(roughness, (object) => changed(object, { roughness: roughness.valueAsNumber }));
  slide(metallic, (object) => changed(object, { metallic: metallic.valueAsNumber }));
  slide(gloss, () => ({ do: "floor-gloss", gloss: gloss.valueAsNumber }));
  on(roughnessNumber, "change", (object) => finite(roughnessNumber) !== null && changed(object, { roughness: finite(roughnessNumber) }));
  on(metallicNumber, "change", (object) => finite(metallicNumber) !== null && changed(object, { metallic: finite(metallicNumber) }));
  on(glossNumber, "change", () => finite(glossNumber) !== null && { do: "floor-gloss", gloss: finite(glossNumber) });

  return (object) => {
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
    for (const control of [gloss, glossNumber]) fill(control, short(page.view.floor_gloss));
  };
}
