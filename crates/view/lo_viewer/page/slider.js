// A slider with a number field.

import { element, fill, short } from "./dom.js";

/**
 * Builds a slider with a number field. `command(value)` is previewed while the slider moves and committed when it is
 * released; a typed number is executed at once. Returns `range` (the slider, with the `id`), `root` with both controls,
 * `show(value)` and `enable(isOn)`.
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
    show(value) {
      shown = short(value);
      for (const control of [range, number]) fill(control, shown);
    },
    enable(isOn) {
      range.disabled = number.disabled = !isOn;
    },
  };
}
