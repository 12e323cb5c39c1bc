// Controls of the light of unobserved regions: the choice, its contrast and warmth, and the white pixel.

import { byId, element, fill, short } from "./dom.js";
import { numberSlider } from "./slider.js";

/** @import { Pixel } from "./camera.js" */
/** @import { Command, LightMode } from "./protocol.d.ts" */
/** @import { Page } from "./store.js" */

/** @type {LightMode[]} */
const LIGHTS = ["even", "expected", "plausible"];
const TITLE = "Even: no lamps in unobserved regions. Expected: correct on average, with soft shadows. "
  + "Plausible: gathered into lamps and windows, with sharp shadows.";

/** Notes on choices without effect. */
const NOTES = {
  none: "A network did not infer the light of this scene: there is nothing to choose.",
  expected: "",
  fitted: "This scene has no expected light: contrast, warmth and white have no effect, and expected light equals even light.",
};

/**
 * Builds the controls. Returns their `root`, and `show()` to update them.
 *
 * @param {Page} page
 * @param {(command: Command) => void} act
 */
export function inferredLight(page, act) {
  const fields = element("div", { className: "fields" });
  /** @type {(text: string, id: string, control: HTMLElement) => void} */
  const field = (text, id, control) => fields.append(element("label", { textContent: text, htmlFor: id }), control);
  const options = LIGHTS.map((value) => element("option", { value, textContent: value }));
  const choice = element("select", { id: "inferred-light", title: TITLE }, ...options);
  choice.onchange = () => {
    const light = LIGHTS.find((name) => name === choice.value);
    if (light) act({ do: "inferred-light", light });
  };
  /**
   * @param {string} id
   * @param {string} name
   * @param {[number, number]} range
   * @param {number} step
   * @param {(value: number) => Command} command
   */
  const slider = (id, name, [min, max], step, command) => numberSlider(page, { id, name, min, max, step, command });
  const contrast = slider("contrast", "Contrast", [0, 3], 0.05, (factor) => ({ do: "contrast", factor }));
  const warmth = slider("warmth", "Warmth in stops", [-4, 4], 0.1, (ev) => ({ do: "warmth", ev }));
  /** @type {(id: string, textContent: string, extra: Record<string, string>) => HTMLButtonElement} */
  const button = (id, textContent, extra) => element("button", { type: "button", id, textContent, ...extra });
  const pick = button("pick-white", "Pick white", { "aria-pressed": "false" });
  const clear = button("clear-white", "Clear", { "aria-label": "Clear the white pixel" });
  clear.onclick = () => act({ do: "white", pixel: null });
  const at = element("span", { className: "note", id: "white-at" });
  field("Light", choice.id, choice);
  field("Contrast", contrast.range.id, contrast.root);
  field("Warmth, EV", warmth.range.id, warmth.root);
  field("White", pick.id, element("div", { className: "row" }, pick, clear));
  fields.append(at);
  const note = element("p", { className: "note" });

  const hint = byId("pick-hint");
  /** @param {boolean} isOn */
  const picking = (isOn) => {
    page.picking = isOn ? picked : null;
    hint.textContent = "Click something white in the photo. Esc cancels.";
    pick.setAttribute("aria-pressed", String(isOn));
    hint.hidden = !isOn;
  };
  /**
   * Ends the picking with a pixel, or null.
   *
   * @param {Pixel | null} pixel
   */
  const picked = (pixel) => {
    picking(false);
    if (pixel) act({ do: "white", pixel });
  };
  pick.onclick = () => {
    const isOff = page.picking === picked;
    page.picking?.(null);
    if (isOff) return;
    byId("view-photo").click();
    byId("stage").focus();
    picking(true);
  };

  return {
    root: element("div", { className: "inferred" }, fields, note),
    show() {
      const { light, contrast: factor, warmth_ev, white, effect } = page.openView().inferred_light;
      const isTuned = effect === "expected" && light !== "even";
      fill(choice, light);
      choice.disabled = effect === "none";
      contrast.show(factor);
      contrast.enable(isTuned && light === "plausible");
      warmth.show(warmth_ev);
      warmth.enable(isTuned);
      pick.disabled = !isTuned;
      clear.disabled = !isTuned || !white;
      clear.hidden = !white;
      at.hidden = !white;
      at.textContent = white ? `at ${white.map((position) => short(Math.floor(position))).join(", ")}` : "";
      note.hidden = effect === "expected";
      note.textContent = NOTES[effect];
      if (!isTuned && page.picking === picked) picked(null);
    },
  };
}
