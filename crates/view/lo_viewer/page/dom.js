// Helpers for DOM elements, and conversion of colours.

export const byId = (id) => document.getElementById(id);

/** Creates an element with properties and children. */
export function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in made && !name.startsWith("aria")) made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

/** Sets the value of a field, unless the user is typing in it. */
export function fill(field, value) {
  const isTyped = document.activeElement === field && (field.type === "number" || field.type === "text");
  if (!isTyped && field.value !== String(value)) field.value = value;
}

/** Formats a number with at most three decimals. */
export const short = (number) => String(Math.round(1000 * number) / 1000);

/** Shows a message until it times out, is closed, or the returned function is called. */
export function showMessage(text, isWrong = false) {
  const messages = byId("messages");
  const shown = [...messages.children].find((other) => other.firstChild.textContent === text);
  if (shown) return () => shown.remove();
  const close = element("button", { textContent: "×", "aria-label": "Close" });
  const message = element("div", { className: isWrong ? "wrong" : "" }, element("span", { textContent: text }), close);
  close.onclick = () => message.remove();
  setTimeout(() => message.remove(), isWrong ? 20000 : 9000);
  messages.append(message);
  while (messages.children.length > 4) messages.firstChild.remove();
  return () => message.remove();
}

const linear = (code) => (code <= 0.04045 ? code / 12.92 : ((code + 0.055) / 1.055) ** 2.4);
const coded = (value) => (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);

/** Converts linear RGB to "#rrggbb". */
export function hexFromLinear(rgb) {
  const code = (value) => Math.round(255 * coded(Math.min(Math.max(value, 0), 1)));
  return `#${rgb.map((value) => code(value).toString(16).padStart(2, "0")).join("")}`;
}

/** Converts "#rrggbb" to linear RGB. */
export function linearFromHex(hex) {
  return [1, 3, 5].map((at) => Math.round(1e5 * linear(parseInt(hex.slice(at, at + 2), 16) / 255)) / 1e5);
}

export { coded, linear };
