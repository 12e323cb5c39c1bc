// Pointer and keys on the photo: selecting, moving and editing objects.

import { add, alongAxis, axes, complete, corners, dot, isInHull, minus, onPlane, project, times } from "./camera.js";
import { around } from "./dom.js";
import { handleAt, heightAboveFloor } from "./handles.js";
import { levelAxes } from "./orbit.js";

/** @import { Pixel, Vector } from "./camera.js" */
/** @import { Gizmo, Handle } from "./handles.js" */
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

/** Least and largest longest side of an object, metres. */
const SIDES_M = [0.005, 20];

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
    const gizmo = page.gizmo();
    const handle = handleAt(gizmo, pixel, page.reach());
    const object = handle ? selected : objectAt(page, pixel);
    page.select(object ? object.id : null);
    stage.focus();
    if (!object) {
      page.startPan(event);
      return;
    }
    stage.setPointerCapture(event.pointerId);
    gesture = handle && gizmo ? beginHandle(page, object, gizmo, handle, pixel) : beginMove(page, object, pixel);
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
    const handle = page.picking ? null : handleAt(page.gizmo(), pixel, page.reach());
    page.hovered = page.picking ? null : handle ? page.selected() : objectAt(page, pixel);
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
      const menus = document.querySelectorAll("details.menu[open]");
      if (menus.length) menus.forEach((menu) => menu.removeAttribute("open"));
      else if (page.picking) page.picking(null);
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
 * Returns the nearest visible, unlocked object whose bounding box covers a photo position.
 *
 * @param {Page} page
 * @param {Pixel} pixel
 */
function objectAt(page, pixel) {
  const { camera } = page.openScene();
  /** @param {ObjectView} object */
  const distance = (object) => Math.hypot(...object.position_m);
  const seen = (page.view?.objects ?? []).filter((object) => {
    if (object.is_hidden || object.is_locked) return false;
    const box = complete(corners(object).map((corner) => project(camera, corner)));
    return box && isInHull(box, pixel);
  });
  return seen.sort((a, b) => distance(a) - distance(b))[0] ?? null;
}

/**
 * Starts to move an object along the surfaces of the room; null if its base is behind the camera.
 *
 * @param {Page} page
 * @param {ObjectView} object
 * @param {Pixel} from
 * @returns {Gesture | null}
 */
function beginMove(page, object, from) {
  const { id } = object;
  const base = project(page.openScene().camera, object.position_m);
  if (!base) return null;
  const offset = [base[0] - from[0], base[1] - from[1]];
  return { handle: "move", object: id, command: ([u, v]) => ({ do: "drag", object: id, to: [u + offset[0], v + offset[1]] }) };
}

/**
 * Starts a gesture on a handle.
 *
 * @param {Page} page
 * @param {ObjectView} object
 * @param {Gizmo} gizmo
 * @param {Handle} handle
 * @param {Pixel} from
 * @returns {Gesture}
 */
function beginHandle(page, object, gizmo, handle, from) {
  const { camera, up, extent } = page.openScene();
  const { id } = object;
  /**
   * Returns the gesture whose command depends on the change of a measure.
   *
   * @param {(pixel: Pixel) => number | null} measure
   * @param {(change: number) => Command} command
   * @returns {Gesture}
   */
  const by = (measure, command) => {
    const start = measure(from);
    return {
      handle,
      object: id,
      command(pixel) {
        const now = measure(pixel);
        return now === null || start === null ? null : command(now - start);
      },
    };
  };
  if (handle === "turn") {
    const [x, , z] = axes({ ...object, yaw_deg: 0 });
    return by((pixel) => {
      const point = onPlane(camera, pixel, gizmo.ring_m, object.up);
      const flat = point && minus(point, gizmo.ring_m);
      return flat && Math.atan2(dot(flat, x), dot(flat, z)) * DEGREES;
    }, (change) => ({ do: "turn", object: id, yaw_deg: round(rotated(object, wrapped(change)), 10) }));
  }
  if (handle === "size") {
    const middle = project(camera, gizmo.anchor_m) ?? from;
    const start = Math.max(Math.hypot(from[0] - middle[0], from[1] - middle[1]), 1);
    return { handle, object: id, command: ([u, v]) => scaled(object, Math.max(Math.hypot(u - middle[0], v - middle[1]) / start, 0.02)) };
  }
  const axis = levelAxes(up)[handle];
  return by((pixel) => alongAxis(camera, pixel, gizmo.anchor_m, axis), (change) => {
    const moved = add(object.position_m, times(axis, change));
    const pixel = object.rests && handle !== "up" ? project(camera, moved) : null;
    // What stands keeps to its surface.
    if (pixel) return { do: "drag", object: id, to: pixel };
    return { do: "place", object: id, place: { position: aboveFloor(moved, up, extent.floor_m) } };
  });
}

/**
 * Returns a position, raised to the floor if it is below.
 *
 * @type {(position: Vector, up: Vector, floor_m: number) => Vector}
 */
export function aboveFloor(position, up, floor_m) {
  return add(position, times(up, Math.max(-heightAboveFloor(position, up, floor_m), 0)));
}

/**
 * Returns the command that scales an object by a factor, within limits of its size.
 *
 * @param {Pick<ObjectView, "id" | "size" | "size_m">} object
 * @param {number} factor
 * @returns {Command}
 */
export function scaled({ id, size, size_m }, factor) {
  const longest = Math.max(...size_m);
  const within = Math.min(Math.max(factor, Math.min(SIDES_M[0] / longest, 1)), Math.max(SIDES_M[1] / longest, 1));
  /** @param {number} length */
  const rounded = (length) => Number((length * within).toPrecision(4));
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
  if (!object) {
    const direction = { "+": 1, "=": 1, "-": -1 }[name];
    if (direction) page.zoom(direction);
    return direction ? null : undefined;
  }
  const { camera, up, extent } = page.openScene();
  const base = project(camera, object.position_m);
  const step = (isFine ? 0.001 : 0.01) * camera.width;
  /** @type {(du: number, dv: number) => FromPage | null} */
  const drag = (du, dv) => base && command({ do: "drag", object: object.id, to: [base[0] + du, base[1] + dv] });
  /** @param {number} metres */
  const lift = (metres) => {
    const position = aboveFloor(add(object.position_m, times(up, metres)), up, extent.floor_m);
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
    case "g": case "G": return command({ do: "put-down", object: object.id });
    case "h": case "H": return command({ do: "show", object: object.id, is_shown: object.is_hidden });
    case "l": case "L": return command({ do: "lock", object: object.id, is_locked: !object.is_locked });
    case "Delete": case "Backspace": return command({ do: "delete", object: object.id });
    default: return undefined;
  }
}
