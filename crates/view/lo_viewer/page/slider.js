// A slider with a number field.

import { element, fill, short } from "./dom.js";

/** @import { Command } from "./protocol.d.ts" */
/** @import { Page } from "./store.js" */

/**
 * @typedef {object} SliderOptions
 * @property {string} id
 * @property {string} name Name for screen readers.
 * @property {number} min
 * @property {number} max
 * @property {number} step
 * @property {(value: number) => Command} command
 */

/**
 * Builds a slider with a number field. `command(value)` is previewed while the slider moves and committed when it is
 * released; a typed number is executed at once. Returns `range` (the slider, with the `id`), `root` with both controls,
 * `show(value)` and `enable(isOn)`.
 *
 * @param {Pick<Page, "preview" | "send">} page
 * @param {SliderOptions} options
 */
export function numberSlider(page, { id, name, min, max, step, command }) {
  const range = element("input", { type: "range", id, min, max, step });
  const number = element("input", { type: "number", "aria-label": name, min, max, step });
  let shown = "";
  range.addEventListener("input", () => page.preview(command(range.valueAsNumber)));
  range.addEventListener("change", () => page.send({ type: "commit" }));
  number.addEventListener("change", () => {
    if (Number.isFinite(number.valueAsNumber)) page.send({ type: "command", command: command(number.valueAsNumber) });
  });
  // Restores the value after a refusal or an invalid number.
  number.addEventListener("blur", () => { number.value = shown; });
  return {
    range,
    root: element("div", { className: "row" }, range, number),
    /** @param {number} value */
    show(value) {
      shown = short(value);
      for (const control of [range, number]) fill(control, shown);
    },
    /** @param {boolean} isOn */
    enable(isOn) {
      range.disabled = number.disabled = !isOn;
    },
  };
}
