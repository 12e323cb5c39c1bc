// The scale of the room: a length that the user knows, between two points of the photo.

import { byId, element, fill, short, showMessage } from "./dom.js";
import { drawPath } from "./handles.js";

/** @import { Pixel } from "./camera.js" */
/** @import { Command, ToPage } from "./protocol.d.ts" */
/** @import { Page } from "./store.js" */

/** Texts while the ends are chosen. */
const HINTS = ["Click one end of a length that you know, such as the edge of a door. Esc cancels.", "Click the other end. Esc cancels."];

/**
 * Builds the controls. Returns `show()` to update them, `take(message)` for measured lengths, `reset()`, and `draw` for
 * the canvas over the photo.
 *
 * @param {Page} page
 */
export function measurePanel(page) {
  /** @type {Pixel[]} */
  let ends = [];
  const button = element("button", { type: "button", id: "measure", textContent: "Known length…", "aria-pressed": "false" });
  const restore = element("button", { type: "button", id: "restore-scale", textContent: "Restore", title: "Restore the scale of the estimate" });
  const length = element("input", { type: "number", id: "known-length", min: 0.001, max: 1000, step: "any" });
  const apply = element("button", { type: "submit", id: "scale-room", textContent: "Scale", title: "Scale the room to this length" });
  const form = element("form", { className: "row", hidden: true }, element("label", { textContent: "Real length, m", htmlFor: "known-length" }), length, apply);
  const note = element("p", { className: "note", id: "scale-note" });
  byId("room").append(element("div", { className: "row" }, button, restore), form, note);

  const hint = byId("pick-hint");
  /** @param {boolean} isOn */
  const setPicking = (isOn) => {
    button.setAttribute("aria-pressed", String(isOn));
    hint.hidden = !isOn;
    hint.textContent = HINTS[ends.length] ?? "";
    page.redraw();
  };
  /** @param {Pixel | null} pixel */
  const picked = (pixel) => {
    page.picking = null;
    if (pixel) ends.push(pixel);
    else ends = [];
    const [from, to] = ends;
    if (from && to) page.send({ type: "measure", ends: [from, to] });
    else if (from) page.picking = picked;
    setPicking(page.picking !== null);
  };
  const reset = () => {
    if (page.picking === picked) picked(null);
    ends = [];
    form.hidden = true;
  };
  button.onclick = () => {
    const isOff = page.picking === picked;
    page.picking?.(null);
    reset();
    if (isOff) return;
    byId("view-photo").click();
    byId("stage").focus();
    page.picking = picked;
    setPicking(true);
  };
  /** @param {Command} command */
  const act = (command) => page.send({ type: "command", command });
  restore.onclick = () => act({ do: "known-length", known: null });
  form.onsubmit = (event) => {
    event.preventDefault();
    const [from, to] = ends;
    if (!from || !to || !(length.valueAsNumber > 0)) return;
    act({ do: "known-length", known: { ends: [from, to], length_m: length.valueAsNumber } });
    reset();
    page.redraw();
  };

  return {
    reset,
    show() {
      const { known_length, room_scale } = page.openView();
      restore.hidden = !known_length;
      note.textContent = known_length
        ? `${short(known_length.length_m)} m between two points: the room is ${short(room_scale)} × as large as in its file.`
        : "Lengths are estimated. If you know one, such as the height of a door, the room gets its scale.";
    },
    /** @param {Extract<ToPage, { type: "measured" }>} message */
    take({ ends: measured, length_m }) {
      if (String(measured) !== String(ends)) return;
      if (length_m === null) {
        reset();
        page.redraw();
        showMessage("the photo has no depth at one of these points; choose others", true);
        return;
      }
      form.hidden = false;
      fill(length, short(length_m));
      byId("panel-room").setAttribute("open", "");
      length.focus();
      length.select();
      page.redraw();
    },
    /** @type {(context: CanvasRenderingContext2D, scale: number, rem: number) => void} */
    draw(context, scale, rem) {
      const known = page.view?.known_length;
      if (ends.length) drawEnds(context, scale, rem, ends, "#fff");
      else if (known) drawEnds(context, scale, rem, known.ends, "#ffffffa0", `${short(known.length_m)} m`);
    },
  };
}

/**
 * Draws the ends of a length, and the line between them. The context is translated to the photo's origin.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale Canvas pixels per photo pixel.
 * @param {number} rem Canvas pixels.
 * @param {Pixel[]} ends
 * @param {string} color
 * @param {string} [text]
 */
export function drawEnds(context, scale, rem, ends, color, text = "") {
  drawPath(context, scale, rem, ends, color, 0.1 * rem);
  const reach = (0.5 * rem) / scale;
  for (const [u, v] of ends) {
    drawPath(context, scale, rem, [[u - reach, v], [u + reach, v]], color, 0.1 * rem);
    drawPath(context, scale, rem, [[u, v - reach], [u, v + reach]], color, 0.1 * rem);
  }
  const [from, to] = ends;
  if (!text || !from || !to) return;
  const [x, y] = [((from[0] + to[0]) / 2) * scale + 0.6 * rem, ((from[1] + to[1]) / 2) * scale];
  context.font = `${0.95 * rem}px system-ui, "DejaVu Sans", sans-serif`;
  context.textBaseline = "middle";
  context.lineJoin = "round";
  context.strokeStyle = "#000c";
  context.lineWidth = 0.25 * rem;
  context.strokeText(text, x, y);
  context.fillStyle = "#fff";
  context.fillText(text, x, y);
}
