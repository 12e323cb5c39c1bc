// A slider with its number beside it.

import { element, fill, short } from "./dom.js";

/**
 * Builds one. `command(value)` is previewed while the slider moves and kept when it is let go; a typed number is done at
 * once. The answer: `range`, which has the `id`, `root` with both, `show(value)` and `enable(isOn)`.
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
  // What was refused, or no number, does not stay there.
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
