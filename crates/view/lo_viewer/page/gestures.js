// Pointer and keys on the photo: selecting, moving and editing objects.

import { add, axes, complete, corners, cross, dot, isInHull, minus, onPlane, project, times, unit } from "./camera.js";
import { around } from "./dom.js";
import { handleAt } from "./handles.js";

/** @import { Lens, Pixel } from "./camera.js" */
/** @import { Handle } from "./handles.js" */
/** @import { Command, FromPage, ObjectView } from "./protocol.d.ts" */
/** @import { Page } from "./store.js" */

/**
 * A drag of an object or of one of its handles.
 *
 * @typedef {object} Gesture
 * @property {Handle | "move"} handle
 * @property {number} object Id of the object.
 * @property {(pixel: Pixel) => Command | null} command Returns the command for a pointer position.
 * @property {boolean} [moved] Whether a command was previewed.
 */

const DEGREES = 180 / Math.PI;

/**
 * Listens to the stage and the keyboard. Provides `page.gesture`.
 *
 * @param {HTMLElement} stage
 * @param {Page} page
 */
export function listen(stage, page) {
  /** @type {Gesture | null} */
  let gesture = null;
  page.gesture = () => gesture;

  stage.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || !page.scene) return;
    const pixel = page.photoPosition(event);
    if (page.picking) {
      const { width, height } = page.scene.camera;
      const isInside = pixel[0] >= 0 && pixel[1] >= 0 && pixel[0] < width && pixel[1] < height;
      if (isInside) page.picking([Math.floor(pixel[0]) + 0.5, Math.floor(pixel[1]) + 0.5]);
      event.preventDefault();
      return;
    }
    const selected = page.selected();
    const handle = selected && handleAt(page.scene.camera, selected, pixel, page.reach());
    const object = handle ? selected : objectAt(page, pixel);
    page.select(object ? object.id : null);
    stage.focus();
    if (!object) return;
    stage.setPointerCapture(event.pointerId);
    gesture = begin(page.scene.camera, object, handle ?? "move", pixel);
    page.redraw();
    event.preventDefault();
  });

  stage.addEventListener("pointermove", (event) => {
    if (!page.scene) return;
    const pixel = page.photoPosition(event);
    if (gesture) {
      const command = gesture.command(pixel);
      if (command) {
        gesture.moved = true;
        page.preview(command);
      }
      return;
    }
    const selected = page.selected();
    const handle = !page.picking && selected && handleAt(page.scene.camera, selected, pixel, page.reach());
    page.hovered = page.picking ? null : handle ? selected : objectAt(page, pixel);
    stage.style.cursor = handle ? "grab" : page.hovered ? "move" : "crosshair";
    page.hover(pixel);
    page.redraw();
  });

  /** @param {boolean} isKept */
  const end = (isKept) => {
    if (!gesture) return;
    if (gesture.moved) page.send({ type: isKept ? "commit" : "cancel" });
    gesture = null;
    page.redraw();
  };
  stage.addEventListener("pointerup", () => end(true));
  stage.addEventListener("pointercancel", () => end(false));
  stage.addEventListener("lostpointercapture", () => end(true));
  stage.addEventListener("pointerleave", () => {
    page.hovered = null;
    page.redraw();
  });

  document.addEventListener("keydown", (event) => {
    const isTyping = around(event, "input:not([type=range]):not([type=checkbox]), select, dialog[open]");
    if (!page.scene || isTyping) return;
    if (event.key === "Escape") {
      if (page.picking) page.picking(null);
      else if (gesture) end(false);
      else page.select(null);
      return;
    }
    // These keys belong to the focused control.
    const isElsewhere = around(event, "aside, header, footer, #timeline");
    const isPlain = !event.ctrlKey && !event.metaKey;
    if (isElsewhere && isPlain && /^(Arrow|Page|Enter| )/.test(event.key)) return;
    const command = messageOf(page, event);
    if (command === undefined) return;
    event.preventDefault();
    if (command) page.send(command);
  });
}

/**
 * Returns the nearest object whose bounding box covers a photo position.
 *
 * @param {Page} page
 * @param {Pixel} pixel
 */
function objectAt(page, pixel) {
  const { camera } = page.openScene();
  /** @param {ObjectView} object */
  const distance = (object) => Math.hypot(...object.position_m);
  const seen = (page.view?.objects ?? []).filter((object) => {
    const box = complete(corners(object).map((corner) => project(camera, corner)));
    return box && isInHull(box, pixel);
  });
  return seen.sort((a, b) => distance(a) - distance(b))[0] ?? null;
}

/**
 * Starts a gesture on an object; null if its base is behind the camera.
 *
 * @param {Lens} camera
 * @param {ObjectView} object
 * @param {Handle | "move"} handle
 * @param {Pixel} from
 * @returns {Gesture | null}
 */
function begin(camera, object, handle, from) {
  const { id } = object;
  const [, up] = axes(object);
  const base = project(camera, object.position_m);
  if (!base) return null;
  if (handle === "move") {
    const offset = [base[0] - from[0], base[1] - from[1]];
    return { handle, object: id, command: ([u, v]) => ({ do: "drag", object: id, to: [u + offset[0], v + offset[1]] }) };
  }
  if (handle === "turn") {
    const [x, , z] = axes({ ...object, yaw_deg: 0 });
    /** @param {Pixel} pixel */
    const angle = (pixel) => {
      const point = onPlane(camera, pixel, object.position_m, up);
      const flat = point && minus(point, object.position_m);
      return flat && Math.atan2(dot(flat, x), dot(flat, z)) * DEGREES;
    };
    const start = angle(from);
    return {
      handle,
      object: id,
      command: (pixel) => {
        const now = angle(pixel);
        if (now === null || start === null) return null;
        return { do: "turn", object: id, yaw_deg: round(rotated(object, wrapped(now - start)), 10) };
      },
    };
  }
  if (handle === "lift") {
    // In the vertical plane that faces the camera.
    const facing = unit(cross(cross(up, object.position_m), up));
    /** @param {Pixel} pixel */
    const height = (pixel) => {
      const point = onPlane(camera, pixel, object.position_m, facing);
      return point && dot(minus(point, object.position_m), up);
    };
    const start = height(from);
    return {
      handle,
      object: id,
      command: (pixel) => {
        const now = height(pixel);
        if (now === null || start === null) return null;
        return { do: "place", object: id, place: { position: add(object.position_m, times(up, now - start)) } };
      },
    };
  }
  /** @param {Pixel} pixel */
  const away = ([u, v]) => Math.hypot(u - base[0], v - base[1]);
  const start = Math.max(away(from), 1);
  return { handle, object: id, command: (pixel) => scaled(object, Math.min(Math.max(away(pixel) / start, 0.02), 50)) };
}

/**
 * Returns the command that scales an object by a factor.
 *
 * @param {Pick<ObjectView, "id" | "size">} object
 * @param {number} factor
 * @returns {Command}
 */
export function scaled({ id, size }, factor) {
  /** @param {number} length */
  const rounded = (length) => Number((length * factor).toPrecision(4));
  const changed = "scale" in size ? { scale: rounded(size.scale) } : { height: rounded(size.height) };
  return { do: "size", object: id, size: changed };
}

/** @type {(value: number, steps: number) => number} */
const round = (value, steps) => Math.round(value * steps) / steps;
/**
 * Animated objects may rotate by more than a full turn.
 *
 * @type {(object: ObjectView, by: number) => number}
 */
const rotated = (object, by) => (object.path ? object.yaw_deg + by : wrapped(object.yaw_deg + by));
/** @type {(angle: number) => number} */
const wrapped = (angle) => angle - 360 * Math.round(angle / 360);
/** @type {(made: Command) => FromPage} */
const command = (made) => ({ type: "command", command: made });

/**
 * Returns the message for a key, null if the key was handled, undefined for other keys.
 *
 * @param {Page} page
 * @param {KeyboardEvent} event
 * @returns {FromPage | null | undefined}
 */
function messageOf(page, event) {
  const { key: name, shiftKey: isFine } = event;
  if (event.ctrlKey || event.metaKey) {
    const letter = name.toLowerCase();
    if (letter === "z") return { type: event.shiftKey ? "redo" : "undo" };
    if (letter === "y") return { type: "redo" };
    const selected = page.selected();
    return letter === "d" && selected ? command({ do: "duplicate", object: selected.id }) : undefined;
  }
  const plain = page.keys[name] ?? page.keys[name.toLowerCase()];
  if (plain) {
    plain();
    return null;
  }
  const object = page.selected();
  if (!object) return undefined;
  const { camera } = page.openScene();
  const base = project(camera, object.position_m);
  const step = (isFine ? 0.001 : 0.01) * camera.width;
  /** @type {(du: number, dv: number) => FromPage | null} */
  const drag = (du, dv) => base && command({ do: "drag", object: object.id, to: [base[0] + du, base[1] + dv] });
  /** @param {number} metres */
  const lift = (metres) => {
    const position = add(object.position_m, times(object.up, metres));
    return command({ do: "place", object: object.id, place: { position } });
  };
  /** @param {number} degrees */
  const rotate = (degrees) => command({ do: "turn", object: object.id, yaw_deg: rotated(object, degrees) });
  switch (name) {
    case "ArrowLeft": return drag(-step, 0);
    case "ArrowRight": return drag(step, 0);
    case "ArrowUp": return drag(0, -step);
    case "ArrowDown": return drag(0, step);
    case "PageUp": return lift(isFine ? 0.002 : 0.02);
    case "PageDown": return lift(isFine ? -0.002 : -0.02);
    case "[": return rotate(5);
    case "]": return rotate(-5);
    case "+": case "=": return command(scaled(object, 1.05));
    case "-": return command(scaled(object, 1 / 1.05));
    case "g": case "G": return base && command(putDown(object, base));
    case "Delete": case "Backspace": return command({ do: "delete", object: object.id });
    default: return undefined;
  }
}

/**
 * Returns the command that puts an object down on the surface seen at its base, a photo position.
 *
 * @type {(object: Pick<ObjectView, "id">, base: Pixel) => Command}
 */
export const putDown = ({ id }, base) => ({ do: "place", object: id, place: { pixel: base } });
