// Helpers for DOM elements, and conversion of colours.

/** @import { Vector } from "./camera.js" */

/**
 * Elements of `index.html` by id, where code uses more than an `HTMLElement` has.
 *
 * @typedef {object} Elements
 * @property {HTMLButtonElement} add-key
 * @property {HTMLInputElement} exposure
 * @property {HTMLInputElement} fps
 * @property {HTMLInputElement} frames
 * @property {HTMLCanvasElement} handles
 * @property {HTMLDialogElement} help
 * @property {HTMLDialogElement} leave
 * @property {HTMLSelectElement} interpolation
 * @property {HTMLFormElement} open
 * @property {HTMLInputElement} open-files
 * @property {HTMLProgressElement} opening-progress
 * @property {HTMLCanvasElement} outside
 * @property {HTMLSelectElement} overlay
 * @property {HTMLCanvasElement} picture
 * @property {HTMLButtonElement} play
 * @property {HTMLInputElement} playhead
 * @property {HTMLProgressElement} progress
 * @property {HTMLFormElement} properties
 * @property {HTMLButtonElement} redo
 * @property {HTMLDetailsElement} export
 * @property {HTMLProgressElement} sequence-progress
 * @property {HTMLButtonElement} undo
 * @property {HTMLButtonElement} zoom-out
 */

/**
 * Returns the element of the page with an id.
 *
 * @template {string} Id
 * @param {Id} id
 * @returns {Id extends keyof Elements ? Elements[Id] : HTMLElement}
 */
export function byId(id) {
  // A unit test compares the ids with `index.html`.
  return /** @type {any} */ (document.getElementById(id));
}

/**
 * Returns the 2D context of a canvas.
 *
 * @overload
 * @param {HTMLCanvasElement} canvas
 * @param {CanvasRenderingContext2DSettings} [settings]
 * @returns {CanvasRenderingContext2D}
 */
/**
 * @overload
 * @param {OffscreenCanvas} canvas
 * @param {CanvasRenderingContext2DSettings} [settings]
 * @returns {OffscreenCanvasRenderingContext2D}
 */
/**
 * @param {HTMLCanvasElement | OffscreenCanvas} canvas
 * @param {CanvasRenderingContext2DSettings} [settings]
 */
export function contextOf(canvas, settings) {
  const context = canvas.getContext("2d", settings);
  if (!context) throw new Error("the browser has no 2D canvas");
  return context;
}

/**
 * Returns the innermost element around an event's target that matches a selector, or null.
 *
 * @param {Event} event
 * @param {string} selectors
 * @returns {HTMLElement | null}
 */
export function around({ target }, selectors) {
  return target instanceof Element ? target.closest(selectors) : null;
}

/**
 * Creates an element with properties and children.
 *
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {Record<string, unknown>} [properties]
 * @param {(Node | string)[]} children
 */
export function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in made && !name.startsWith("aria")) Object.assign(made, { [name]: value });
    else made.setAttribute(name, String(value));
  }
  made.append(...children);
  return made;
}

/**
 * Sets the value of a field, unless the user is typing in it.
 *
 * @param {HTMLInputElement | HTMLSelectElement} field
 * @param {string | number} value
 */
export function fill(field, value) {
  const isTyped = document.activeElement === field && (field.type === "number" || field.type === "text");
  if (!isTyped && field.value !== String(value)) field.value = String(value);
}

/**
 * Formats a number with at most three decimals.
 *
 * @type {(number: number) => string}
 */
export const short = (number) => String(Math.round(1000 * number) / 1000);

/**
 * Shows a message until it times out, is closed, or the returned function is called.
 *
 * @param {string} text
 */
export function showMessage(text, isWrong = false) {
  const messages = byId("messages");
  const shown = [...messages.children].find((other) => other.firstChild?.textContent === text);
  if (shown) return () => shown.remove();
  const close = element("button", { textContent: "×", "aria-label": "Close" });
  const message = element("div", { className: isWrong ? "wrong" : "" }, element("span", { textContent: text }), close);
  close.onclick = () => message.remove();
  setTimeout(() => message.remove(), isWrong ? 20000 : 9000);
  messages.append(message);
  while (messages.children.length > 4) messages.firstElementChild?.remove();
  return () => message.remove();
}

/**
 * Copies the text of an element and returns whether that succeeded. If not, the text stays selected.
 *
 * The clipboard's interface exists only in secure contexts: over https, and on this machine. The older command works
 * over http, too.
 *
 * @param {HTMLElement} shown
 */
export async function copyText(shown) {
  try {
    if (navigator.clipboard) {
      await navigator.clipboard.writeText(shown.textContent ?? "");
      return true;
    }
  } catch {
    // Permission denied: the older command may still work.
  }
  const selection = getSelection();
  selection?.selectAllChildren(shown);
  const isCopied = document.execCommand("copy");
  if (isCopied) selection?.removeAllRanges();
  return isCopied;
}

/**
 * Converts an sRGB code in [0, 1] to a linear value.
 *
 * @type {(code: number) => number}
 */
export const linear = (code) => (code <= 0.04045 ? code / 12.92 : ((code + 0.055) / 1.055) ** 2.4);
/**
 * Converts a linear value in [0, 1] to an sRGB code.
 *
 * @type {(value: number) => number}
 */
export const coded = (value) => (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);

/**
 * Converts linear RGB to "#rrggbb".
 *
 * @param {number[]} rgb
 */
export function hexFromLinear(rgb) {
  /** @param {number} value */
  const code = (value) => Math.round(255 * coded(Math.min(Math.max(value, 0), 1)));
  return `#${rgb.map((value) => code(value).toString(16).padStart(2, "0")).join("")}`;
}

/**
 * Converts "#rrggbb" to linear RGB.
 *
 * @param {string} hex
 * @returns {Vector}
 */
export function linearFromHex(hex) {
  /** @param {number} at */
  const value = (at) => Math.round(1e5 * linear(parseInt(hex.slice(at, at + 2), 16) / 255)) / 1e5;
  return [value(1), value(3), value(5)];
}
