// The panel of lights: the choice of light, the room's lights with their edits, and added lights.

import { direction, times } from "./camera.js";
import { around, byId, element, fill, hexFromLinear, linearFromHex, short } from "./dom.js";
import { inferredLight } from "./inferred.js";
import { numberSlider } from "./slider.js";

/** @import { Vector } from "./camera.js" */
/** @import { Command, LightChange, LightView, NewLight } from "./protocol.d.ts" */
/** @import { Page } from "./store.js" */

const KINDS = { lamp: "lamp", window: "window", "bright-surface": "bright surface", area: "lamp", sun: "sun" };
const ORIGINS = { seen: "observed", panorama: "from the panorama", guessed: "inferred", added: "added" };

/**
 * Builds the panel. Returns a function that updates it.
 *
 * @param {Page} page
 */
export function lightsPanel(page) {
  const panel = byId("lights");
  /** @param {Command} command */
  const act = (command) => page.send({ type: "command", command });
  const list = element("div", { className: "lights" });
  list.style.display = "grid";
  list.style.gap = "0.5rem";
  const none = element("p", { className: "note", textContent: "No lamps, windows or bright surfaces were found in this room." });
  /** @type {(text: string, onclick: () => void) => HTMLButtonElement} */
  const button = (text, onclick) => element("button", { type: "button", textContent: text, onclick });
  const sun = { sun: { azimuth_deg: -40, elevation_deg: 40, strength: 3, angle_deg: 1, kelvin: 5500 } };
  const inferred = inferredLight(page, act);
  panel.append(inferred.root, list, none, element("div", { className: "row" },
    button("Add sun", () => act({ do: "add-light", new: sun })),
    button("Add lamp", () => act({ do: "add-light", new: { sphere: { at_m: overhead(page), radius_m: 0.08, radiance: 40, kelvin: 3500 } } })),
    button("Reset all", () => act({ do: "reset-lights" }))));
  panel.style.display = "grid";
  panel.style.gap = "0.5rem";

  /** @type {Map<string, ReturnType<typeof lightRow>>} */
  const rows = new Map();
  return () => {
    const { lights } = page.openView();
    inferred.show();
    none.hidden = lights.length > 0;
    for (const [id, row] of rows) {
      if (!lights.some((light) => light.id === id)) {
        row.root.remove();
        rows.delete(id);
      }
    }
    for (const light of lights) {
      let row = rows.get(light.id);
      if (!row) {
        row = lightRow(page, act, light);
        rows.set(light.id, row);
        list.append(row.root);
      }
      row.show(light);
    }
  };
}

/**
 * Returns the position of a new lamp: in the upper part of the photo, 1.5 m away.
 *
 * @param {Pick<Page, "openScene">} page
 * @returns {Vector}
 */
export function overhead(page) {
  const { camera } = page.openScene();
  return times(direction(camera, [0.5 * camera.width, 0.2 * camera.height]), 1.5);
}

/**
 * Builds the row of a light. Returns its `root`, and `show(light)` to update it.
 *
 * @param {Page} page
 * @param {(command: Command) => void} act
 * @param {LightView} first
 */
function lightRow(page, act, first) {
  const { id, kind, origin } = first;
  let light = first;
  const isAdded = origin === "added";
  const on = element("input", { type: "checkbox", "aria-label": `Light ${id} on` });
  const name = element("span", { className: "name", textContent: `${id}  ${KINDS[kind]}, ${ORIGINS[origin]}` });
  const head = element("div", { className: "row head", title: "Select it, to drag it in the photo or in the room" }, on, name);
  head.addEventListener("click", (event) => { if (!around(event, "input, button")) page.selectLight(id); });
  const fields = element("div", { className: "fields" });
  const root = element("div", { className: "light" }, head, fields);

  /** @type {(part: LightChange) => Command} */
  const change = (part) => ({ do: "set-light", light: id, change: { ...light.changed, ...part } });
  on.onchange = () => act(change({ on: on.checked }));

  /** @type {(text: string, control: HTMLInputElement) => HTMLInputElement} */
  const field = (text, control) => {
    control.id = `light-${id}-${text.replace(/\W/g, "")}`;
    fields.append(element("label", { textContent: text, htmlFor: control.id }), control);
    return control;
  };
  /**
   * @param {string} text
   * @param {number} min
   * @param {number} max
   * @param {number} step
   * @param {() => number} read
   * @param {(value: number) => Command} command
   */
  const slider = (text, min, max, step, read, command) => {
    const controlId = `light-${id}-${text.replace(/\W/g, "")}`;
    const made = numberSlider(page, { id: controlId, name: `${text} of light ${id}`, min, max, step, command });
    fields.append(element("label", { textContent: text, htmlFor: controlId }), made.root);
    return () => made.show(read());
  };
  /** @type {(() => void)[]} */
  const shows = [];
  // In stops, like exposure.
  shows.push(slider("Brightness", -4, 4, 0.1, () => Math.log2(Math.max(light.changed.scale ?? 1, 1 / 16)),
    (stops) => change({ scale: Number((2 ** stops).toPrecision(4)) })));
  const color = field("Colour", element("input", { type: "color" }));
  color.addEventListener("input", () => page.preview(change({ color: { rgb: linearFromHex(color.value) } })));
  color.addEventListener("change", () => page.send({ type: "commit" }));
  shows.push(() => {
    const { color: chosen } = light.changed;
    const own = chosen && "rgb" in chosen ? chosen.rgb : light.radiance;
    fill(color, hexFromLinear(own.map((value) => value / Math.max(...own, 1e-6))));
  });
  if (kind === "sun") {
    const sun = () => sunOf(light);
    /** @type {(part: Partial<Sun>) => Command} */
    const now = (part) => ({ do: "replace-light", light: id, new: { sun: { ...sun(), ...part } } });
    /** @type {(part: { azimuth_deg?: number, elevation_deg?: number }) => Command} */
    const turn = (part) => {
      const { azimuth_deg, elevation_deg } = sun();
      return { do: "turn-sun", light: id, azimuth_deg, elevation_deg, ...part };
    };
    shows.push(slider("Azimuth, °", -180, 180, 1, () => sun().azimuth_deg, (value) => turn({ azimuth_deg: value })));
    shows.push(slider("Elevation, °", -10, 90, 1, () => sun().elevation_deg, (value) => turn({ elevation_deg: value })));
    shows.push(slider("Diameter, °", 0.2, 20, 0.1, () => sun().angle_deg, (value) => now({ angle_deg: value })));
  } else {
    const axes = ["x", "y", "z"].map((axis) => element("input", { type: "number", step: 0.05, "aria-label": `${axis} of light ${id}, metres` }));
    fields.append(element("label", { textContent: "Position, m" }), element("div", { className: "row" }, ...axes));
    axes.forEach((axis) => axis.addEventListener("change", () => {
      const [x, y, z] = axes.map((other) => other.valueAsNumber);
      if ([x, y, z].every(Number.isFinite)) act(change({ at_m: [x, y, z] }));
    }));
    shows.push(() => (light.changed.at_m ?? light.position_m ?? [0, 0, 0]).forEach((value, i) => fill(axes[i], short(value))));
  }
  const undo = element("button", {
    type: "button",
    textContent: isAdded ? "Remove" : "Reset",
    onclick: () => act(isAdded ? { do: "remove-light", light: id } : { do: "set-light", light: id, change: {} }),
  });
  head.append(undo);
  return {
    root,
    /** @param {LightView} now */
    show(now) {
      light = now;
      on.checked = now.changed.on ?? true;
      light.changed = { on: true, scale: 1, ...now.changed };
      root.classList.toggle("off", !on.checked);
      const isSelected = page.selectedLight === id;
      if (isSelected && !root.classList.contains("selected")) root.scrollIntoView({ block: "nearest" });
      root.classList.toggle("selected", isSelected);
      undo.disabled = !isAdded && JSON.stringify(light.changed) === '{"on":true,"scale":1}';
      shows.forEach((show) => show());
    },
  };
}

/** @typedef {Extract<NewLight, { sun: unknown }>["sun"]} Sun */

/**
 * Returns a sun as it would be added.
 *
 * @param {LightView} light
 * @returns {Sun}
 */
function sunOf({ sun_deg, irradiance, angular_radius_deg, color_temperature_k }) {
  const [azimuth_deg, elevation_deg] = sun_deg ?? [0, 0];
  return {
    azimuth_deg,
    elevation_deg,
    strength: irradiance ?? 0,
    angle_deg: 2 * (angular_radius_deg ?? 0),
    kelvin: color_temperature_k ?? 5500,
  };
}
