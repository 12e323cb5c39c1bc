// Pointer and keys on the photo: selecting, moving and editing objects.

import { add, alongAxis, axes, complete, corners, dot, isInHull, minus, onPlane, project, times } from "./camera.js";
import { around } from "./dom.js";
import { handleAt, heightAboveFloor } from "./handles.js";
import { hintOf, lightDrag, lightHandleAt, markAt, movedTo, placeOf } from "./light_marks.js";
import { levelAxes } from "./orbit.js";
import { together } from "./selection.js";

/** @import { Pixel, Vector } from "./camera.js" */
/** @import { Gizmo, Handle } from "./handles.js" */
/** @import { LightHandle } from "./light_marks.js" */
/** @import { Command, FromPage, ObjectView, SceneInfo } from "./protocol.d.ts" */
/** @import { Page } from "./store.js" */

/**
 * A drag of objects, of a handle, or of a light.
 *
 * @typedef {object} Gesture
 * @property {Handle | "move" | "mark" | "shadow"} handle
 * @property {number | null} object Id of the object; null for a light.
 * @property {(pixel: Pixel, isShift: boolean) => Command | null} command Returns the command for a pointer position.
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
  /** @type {number | null} */
  let clicked = null;
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
    const [reach, lights] = [page.reach(), page.photoLights()];
    const selected = page.selected();
    const gizmo = page.gizmo();
    const isAdding = event.shiftKey;
    const own = isAdding ? null : lightHandleAt(lights, pixel, reach);
    const handle = own || isAdding ? null : handleAt(gizmo, pixel, reach);
    const light = own ?? (handle ? null : markAt(lights, pixel, reach));
    if (light) {
      if (light.kind === "mark") page.selectLight(light.mark.light.id);
      begin(event, beginLight(page, light, pixel));
      return;
    }
    const object = handle ? selected : objectAt(page, pixel);
    const isKept = object !== null && (handle !== null || (!isAdding && page.isSelected(object.id)));
    if (!isKept) page.select(object ? object.id : null, isAdding);
    stage.focus();
    if (!object) {
      page.startPan(event);
      return;
    }
    // A click on one of several selected objects selects it alone; a drag moves all of them.
    clicked = isKept && !handle ? object.id : null;
    if (isAdding && !handle) event.preventDefault();
    else begin(event, handle && gizmo ? beginHandle(page, object, gizmo, handle, pixel) : beginMove(page, pixel));
  });

  stage.addEventListener("pointermove", (event) => {
    if (!page.scene) return;
    const pixel = page.photoPosition(event);
    if (gesture) {
      const command = gesture.command(pixel, event.shiftKey);
      if (command) {
        gesture.moved = true;
        page.preview(command);
      }
      return;
    }
    const [reach, lights] = [page.reach(), page.photoLights()];
    const own = page.picking ? null : lightHandleAt(lights, pixel, reach);
    const handle = page.picking || own ? null : handleAt(page.gizmo(), pixel, reach);
    const light = own ?? (page.picking || handle ? null : markAt(lights, pixel, reach));
    page.hovered = page.picking || light ? null : handle ? page.selected() : objectAt(page, pixel);
    stage.style.cursor = handle || light ? "grab" : page.hovered ? "move" : "crosshair";
    page.hint(light ? hintOf(light) : "");
    page.hover(pixel);
    page.redraw();
  });

  /** @type {(event: PointerEvent, begun: Gesture | null) => void} */
  const begin = (event, begun) => {
    stage.focus();
    stage.setPointerCapture(event.pointerId);
    gesture = begun;
    page.redraw();
    event.preventDefault();
  };

  /** @param {boolean} isKept */
  const end = (isKept) => {
    if (!gesture) return;
    if (gesture.moved) page.send({ type: isKept ? "commit" : "cancel" });
    else if (isKept && clicked !== null) page.select(clicked);
    gesture = clicked = null;
    page.redraw();
  };
  stage.addEventListener("pointerup", () => end(true));
  stage.addEventListener("pointercancel", () => end(false));
  stage.addEventListener("lostpointercapture", () => end(true));
  stage.addEventListener("pointerleave", () => {
    page.hovered = null;
    page.hint("");
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
 * Starts to move the selected objects along the surfaces of the room; null if no base is in front of the camera.
 *
 * @param {Page} page
 * @param {Pixel} from
 * @returns {Gesture | null}
 */
function beginMove(page, from) {
  const moving = page.group().filter(({ is_locked }) => !is_locked).flatMap(({ id, position_m }) => {
    const base = project(page.openScene().camera, position_m);
    return base ? [{ id, offset: [base[0] - from[0], base[1] - from[1]] }] : [];
  });
  if (!moving.length) return null;
  return {
    handle: "move",
    object: page.selectedId,
    command: ([u, v]) => together(moving.map(({ id, offset }) => ({ do: "drag", object: id, to: [u + offset[0], v + offset[1]] }))),
  };
}

/**
 * Starts to drag a light.
 *
 * @type {(page: Page, handle: LightHandle, from: Pixel) => Gesture}
 */
function beginLight(page, handle, from) {
  return { handle: handle.kind === "arrow" ? handle.name : handle.kind, object: null, command: lightDrag(page, handle, from) };
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
  const { camera, up } = page.openScene();
  const { id } = object;
  const group = page.group().filter((other) => other.id === id || !other.is_locked);
  /** @param {(object: ObjectView) => Command} command */
  const each = (command) => together(group.map(command));
  /**
   * Returns the gesture whose command depends on the change of a measure.
   *
   * @param {(pixel: Pixel) => number | null} measure
   * @param {(change: number) => Command | null} command
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
    }, (change) => each((other) => ({ do: "turn", object: other.id, yaw_deg: round(rotated(other, wrapped(change)), 10) })));
  }
  if (handle === "size") {
    const middle = project(camera, gizmo.anchor_m) ?? from;
    const start = Math.max(Math.hypot(from[0] - middle[0], from[1] - middle[1]), 1);
    return {
      handle,
      object: id,
      command: ([u, v]) => each((other) => scaled(other, Math.max(Math.hypot(u - middle[0], v - middle[1]) / start, 0.02))),
    };
  }
  const axis = levelAxes(up)[handle];
  return by(
    (pixel) => alongAxis(camera, pixel, gizmo.anchor_m, axis),
    (change) => each((other) => movedAlong(page.openScene(), other, times(axis, change), handle === "up")),
  );
}

/**
 * Returns the command that moves an object; what stands keeps to its surface unless it is lifted.
 *
 * @type {(scene: SceneInfo, object: ObjectView, by: Vector, isLift: boolean) => Command}
 */
function movedAlong({ camera, up, extent }, { id, position_m, rests }, by, isLift) {
  const moved = add(position_m, by);
  const pixel = rests && !isLift ? project(camera, moved) : null;
  if (pixel) return { do: "drag", object: id, to: pixel };
  return { do: "place", object: id, place: { position: aboveFloor(moved, up, extent.floor_m) } };
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
/** @type {(made: Command | null) => FromPage | null} */
const message = (made) => made && { type: "command", command: made };

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
    const copies = page.group().map(({ id }) => /** @type {Command} */ ({ do: "duplicate", object: id }));
    return letter === "d" ? message(together(copies)) ?? undefined : undefined;
  }
  const plain = page.keys[name] ?? page.keys[name.toLowerCase()];
  if (plain) {
    plain();
    return null;
  }
  if (page.selectedLight !== null) return ofLight(page, name, isFine);
  const object = page.selected();
  if (!object) {
    const direction = { "+": 1, "=": 1, "-": -1 }[name];
    if (direction) page.zoom(direction);
    return direction ? null : undefined;
  }
  const { camera, up } = page.openScene();
  const step = (isFine ? 0.001 : 0.01) * camera.width;
  const group = page.group();
  /** @param {(object: ObjectView) => Command | null} command */
  const each = (command) => message(together(group.map(command)));
  /** @type {(du: number, dv: number) => FromPage | null} */
  const drag = (du, dv) => each(({ id, position_m }) => {
    const base = project(camera, position_m);
    return base && { do: "drag", object: id, to: [base[0] + du, base[1] + dv] };
  });
  /** @param {number} metres */
  const lift = (metres) => each((other) => movedAlong(page.openScene(), other, times(up, metres), true));
  /** @param {number} degrees */
  const rotate = (degrees) => each((other) => ({ do: "turn", object: other.id, yaw_deg: rotated(other, degrees) }));
  switch (name) {
    case "ArrowLeft": return drag(-step, 0);
    case "ArrowRight": return drag(step, 0);
    case "ArrowUp": return drag(0, -step);
    case "ArrowDown": return drag(0, step);
    case "PageUp": return lift(isFine ? 0.002 : 0.02);
    case "PageDown": return lift(isFine ? -0.002 : -0.02);
    case "[": return rotate(5);
    case "]": return rotate(-5);
    case "+": case "=": return each((other) => scaled(other, 1.05));
    case "-": return each((other) => scaled(other, 1 / 1.05));
    case "g": case "G": return each(({ id }) => ({ do: "put-down", object: id }));
    case "h": case "H": return each(({ id }) => ({ do: "show", object: id, is_shown: object.is_hidden }));
    case "l": case "L": return each(({ id }) => ({ do: "lock", object: id, is_locked: !object.is_locked }));
    case "Delete": case "Backspace": return each(({ id }) => ({ do: "delete", object: id }));
    default: return undefined;
  }
}

/**
 * Returns the message for a key that applies to the selected light: metres for arrows, or removal.
 *
 * @type {(page: Page, name: string, isFine: boolean) => FromPage | null | undefined}
 */
function ofLight(page, name, isFine) {
  const light = page.view?.lights.find(({ id }) => id === page.selectedLight);
  const { right, up, ahead } = levelAxes(page.openScene().up);
  const axis = { ArrowLeft: times(right, -1), ArrowRight: right, ArrowUp: ahead, ArrowDown: times(ahead, -1), PageUp: up, PageDown: times(up, -1) }[name];
  const place = light && placeOf(light);
  if (axis && place) return message(movedTo(light, add(place, times(axis, isFine ? 0.005 : 0.05))));
  const isRemoval = name === "Delete" || name === "Backspace";
  return isRemoval && light?.origin === "added" ? message({ do: "remove-light", light: light.id }) : undefined;
}
