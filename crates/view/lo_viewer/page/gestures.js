// Pointer and keys on the photo: selecting, moving and editing objects.

import { add, axes, corners, cross, dot, isInHull, minus, onPlane, project, times, unit } from "./camera.js";
import { handleAt } from "./handles.js";

const DEGREES = 180 / Math.PI;

/** Listens to the stage and the keyboard. Provides `page.gesture`. */
export function listen(stage, page) {
  let gesture = null;
  page.gesture = () => gesture;

  stage.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || !page.scene) return;
    const pixel = page.photoPosition(event);
    if (page.picking) {
      const { width, height } = page.scene.camera;
      const isInside = pixel[0] >= 0 && pixel[1] >= 0 && pixel[0] < width && pixel[1] < height;
      if (isInside) page.picking(pixel.map((position) => Math.floor(position) + 0.5));
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
    const isTyping = event.target.closest?.("input:not([type=range]):not([type=checkbox]), select, dialog[open]");
    if (!page.scene || isTyping) return;
    if (event.key === "Escape") {
      if (page.picking) page.picking(null);
      else if (gesture) end(false);
      else page.select(null);
      return;
    }
    // These keys belong to the focused control.
    const isElsewhere = event.target.closest?.("aside, header, footer, #timeline");
    const isPlain = !event.ctrlKey && !event.metaKey;
    if (isElsewhere && isPlain && /^(Arrow|Page|Enter| )/.test(event.key)) return;
    const command = messageOf(page, event);
    if (command === undefined) return;
    event.preventDefault();
    if (command) page.send(command);
  });
}

/** Returns the nearest object whose bounding box covers a photo position. */
function objectAt(page, pixel) {
  const { camera } = page.scene;
  const distance = (object) => Math.hypot(...object.position_m);
  const seen = (page.view?.objects ?? []).filter((object) => {
    const box = corners(object).map((corner) => project(camera, corner));
    return !box.includes(null) && isInHull(box, pixel);
  });
  return seen.sort((a, b) => distance(a) - distance(b))[0] ?? null;
}

/** Starts a gesture on an object. Its `command(pixel)` returns the command for a pointer position. */
function begin(camera, object, handle, from) {
  const { id } = object;
  const [, up] = axes(object);
  const base = project(camera, object.position_m);
  if (handle === "move") {
    const offset = [base[0] - from[0], base[1] - from[1]];
    return { handle, object: id, command: ([u, v]) => ({ do: "drag", object: id, to: [u + offset[0], v + offset[1]] }) };
  }
  if (handle === "turn") {
    const [x, , z] = axes({ ...object, yaw_deg: 0 });
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
  const away = ([u, v]) => Math.hypot(u - base[0], v - base[1]);
  const start = Math.max(away(from), 1);
  return { handle, object: id, command: (pixel) => scaled(object, Math.min(Math.max(away(pixel) / start, 0.02), 50)) };
}

/** Returns the command that scales an object by a factor. */
export function scaled(object, factor) {
  const [kind, size] = Object.entries(object.size)[0];
  return { do: "size", object: object.id, size: { [kind]: Number((size * factor).toPrecision(4)) } };
}

const round = (value, steps) => Math.round(value * steps) / steps;
/** Animated objects may rotate by more than a full turn. */
const rotated = (object, by) => (object.path ? object.yaw_deg + by : wrapped(object.yaw_deg + by));
const wrapped = (angle) => angle - 360 * Math.round(angle / 360);
const command = (made) => ({ type: "command", command: made });

/** Returns the message for a key, null if the key was handled, undefined for other keys. */
function messageOf(page, event) {
  const { key: name, shiftKey: isFine } = event;
  if (event.ctrlKey || event.metaKey) {
    const letter = name.toLowerCase();
    if (letter === "z") return { type: event.shiftKey ? "redo" : "undo" };
    if (letter === "y") return { type: "redo" };
    if (letter === "d" && page.selected()) return command({ do: "duplicate", object: page.selected().id });
    return undefined;
  }
  const plain = page.keys[name] ?? page.keys[name.toLowerCase()];
  if (plain) {
    plain();
    return null;
  }
  const object = page.selected();
  if (!object) return undefined;
  const { camera } = page.scene;
  const base = project(camera, object.position_m);
  const step = (isFine ? 0.001 : 0.01) * camera.width;
  const drag = (du, dv) => command({ do: "drag", object: object.id, to: [base[0] + du, base[1] + dv] });
  const lift = (metres) => {
    const position = add(object.position_m, times(object.up, metres));
    return command({ do: "place", object: object.id, place: { position } });
  };
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
    case "g": case "G": return command(putDown(camera, object));
    case "Delete": case "Backspace": return command({ do: "delete", object: object.id });
    default: return undefined;
  }
}

/** Returns the command that puts an object down on the surface seen at its base. */
export function putDown(camera, object) {
  return { do: "place", object: object.id, place: { pixel: project(camera, object.position_m) } };
}
