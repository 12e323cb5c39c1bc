// Lights on the photo: their marks, the arrows of the selected one, and the shadows by which suns are aimed.

import { add, alongAxis, direction, dot, project, times, unit } from "./camera.js";
import { hexFromLinear } from "./dom.js";
import { arrowAt, drawArrows, drawPath, gizmoOf, inside } from "./handles.js";
import { levelAxes } from "./orbit.js";

/** @import { Lens, Pixel, Vector } from "./camera.js" */
/** @import { Arrow, Rect } from "./handles.js" */
/** @import { LevelAxes } from "./orbit.js" */
/** @import { Command, LightView, ObjectView, SceneInfo } from "./protocol.d.ts" */
/** @import { Page } from "./store.js" */

/** @typedef {{ light: LightView, at: Pixel }} Mark */
/** @typedef {{ light: LightView, object: number, top: Pixel, tip: Pixel }} Shadow Shadow of an object's top. */
/** @typedef {{ light: LightView, anchor_m: Vector, arrows: Arrow[] }} LightArrows */

/**
 * The lights on the photo; photo positions unless noted.
 *
 * @typedef {object} PhotoLights
 * @property {Mark[]} marks
 * @property {LightArrows | null} selected Arrows of the selected light; null for suns.
 * @property {Shadow[]} shadows Shadows of the selected object.
 */

/**
 * A part of a light that can be dragged.
 *
 * @typedef {{ kind: "mark", mark: Mark } | { kind: "arrow", name: Arrow["name"], of: LightArrows } | { kind: "shadow", shadow: Shadow }} LightHandle
 */

const DEGREES = 180 / Math.PI;

/** A sun is drawn at this distance, metres. */
const SUN_M = 1000;

/** @type {PhotoLights} */
export const NO_LIGHTS = { marks: [], selected: null, shadows: [] };

/**
 * Returns where a light is, metres; null for a sun.
 *
 * @type {(light: LightView) => Vector | null}
 */
export const placeOf = (light) => (light.kind === "sun" ? null : light.changed.at_m ?? light.position_m ?? null);

/**
 * Returns the CSS colour of a light; grey if it is off.
 *
 * @type {(light: LightView) => string}
 */
export function colorOf({ changed, radiance }) {
  if (changed.on === false) return "#9a9a9a";
  const own = changed.color && "rgb" in changed.color ? changed.color.rgb : radiance;
  return hexFromLinear(own.map((value) => value / Math.max(...own, 1e-6)));
}

/**
 * Returns azimuth and elevation of a direction, degrees: to the right of the camera's axis, and above the horizon.
 *
 * @type {(towards: Vector, level: LevelAxes) => { azimuth_deg: number, elevation_deg: number }}
 */
export function sunAngles(towards, { right, up, ahead }) {
  const sine = dot(unit(towards), up);
  return {
    azimuth_deg: Math.atan2(dot(towards, right), dot(towards, ahead)) * DEGREES,
    elevation_deg: Math.asin(Math.min(Math.max(sine, -1), 1)) * DEGREES,
  };
}

/**
 * Returns the marks of the lights that the photo's view contains.
 *
 * @type {(camera: SceneInfo["camera"], lights: LightView[]) => Mark[]}
 */
export function marksOf(camera, lights) {
  return lights.flatMap((light) => {
    const point = placeOf(light) ?? (light.direction ? times(light.direction, SUN_M) : null);
    const at = point && project(camera, point);
    const isSeen = at && at[0] >= 0 && at[1] >= 0 && at[0] < camera.width && at[1] < camera.height;
    return isSeen ? [{ light, at }] : [];
  });
}

/**
 * Returns the shadows of an object, their ends in the visible part of the photo. `rem` in photo pixels.
 *
 * @type {(camera: Lens, object: ObjectView, lights: LightView[], visible: Rect, rem: number) => Shadow[]}
 */
export function shadowsOf(camera, object, lights, visible, rem) {
  const top = project(camera, add(object.position_m, times(object.up, object.size_m[1])));
  if (!top) return [];
  return object.shadows.flatMap(({ light: id, pixel }) => {
    const light = lights.find((other) => other.id === id);
    return light ? [{ light, object: object.id, top, tip: inside(pixel, visible, rem) }] : [];
  });
}

/**
 * Returns the arrows of a light; null for a sun, and behind the camera.
 *
 * @type {(camera: Lens, light: LightView, level: LevelAxes, visible: Rect, rem: number) => LightArrows | null}
 */
export function arrowsOf(camera, light, level, visible, rem) {
  const at = placeOf(light);
  const gizmo = at && gizmoOf(camera, { position_m: at, up: level.up, yaw_deg: 0, size_m: [0, 0, 0] }, level, visible, rem);
  return gizmo && { light, anchor_m: gizmo.anchor_m, arrows: gizmo.arrows };
}

/**
 * Returns the lights on the photo.
 *
 * @param {Page} page
 * @returns {PhotoLights}
 */
export function lightsOnPhoto(page) {
  if (!page.scene || !page.view) return NO_LIGHTS;
  const { camera, up } = page.scene;
  const { lights } = page.view;
  const light = lights.find(({ id }) => id === page.selectedLight);
  const object = page.selected();
  const [visible, rem] = [page.visible(), page.reach()];
  return {
    marks: marksOf(camera, lights),
    selected: light ? arrowsOf(camera, light, levelAxes(up), visible, rem) : null,
    shadows: object && !object.is_hidden ? shadowsOf(camera, object, lights, visible, rem) : [],
  };
}

/** @type {(a: Pixel, b: Pixel) => number} */
const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);

/**
 * Returns the end of a shadow, or the mark or an arrow of the selected light at a photo position, or null. `reach` in
 * photo pixels.
 *
 * @type {(lights: PhotoLights, pixel: Pixel, reach: number) => LightHandle | null}
 */
export function lightHandleAt({ marks, selected, shadows }, pixel, reach) {
  const shadow = shadows.find(({ tip }) => distance(tip, pixel) <= reach);
  if (shadow) return { kind: "shadow", shadow };
  // At the border of the photo, an arrow may begin at the mark.
  const mark = marks.find(({ light, at }) => light.id === selected?.light.id && distance(at, pixel) <= 0.6 * reach);
  if (mark) return { kind: "mark", mark };
  const name = selected && arrowAt(selected.arrows, pixel, reach);
  return name ? { kind: "arrow", name, of: selected } : null;
}

/**
 * Returns the light whose mark is at a photo position, or null. `reach` in photo pixels.
 *
 * @type {(lights: PhotoLights, pixel: Pixel, reach: number) => LightHandle | null}
 */
export function markAt({ marks }, pixel, reach) {
  const [mark] = marks.filter(({ at }) => distance(at, pixel) <= 0.9 * reach).sort((a, b) => distance(a.at, pixel) - distance(b.at, pixel));
  return mark ? { kind: "mark", mark } : null;
}

/**
 * Returns what a drag of a light does, for a hint.
 *
 * @type {(handle: LightHandle) => string}
 */
export function hintOf(handle) {
  if (handle.kind === "shadow") return "Drag the end of the shadow: the sun follows.";
  if (handle.kind === "arrow") return `Drag to move the light ${{ right: "to the right or left", up: "up or down", ahead: "ahead or back" }[handle.name]}.`;
  const { id, kind } = handle.mark.light;
  return kind === "sun" ? `${id}: drag to aim the sun.` : `${id}: drag to move it across the view, with Shift along the surfaces of the room.`;
}

/** @type {(light: LightView, at_m: Vector) => Command} */
export const movedTo = (light, [x, y, z]) => {
  const round = (/** @type {number} */ metres) => Math.round(1e4 * metres) / 1e4;
  return { do: "set-light", light: light.id, change: { ...light.changed, at_m: [round(x), round(y), round(z)] } };
};

/**
 * Starts to drag a light; returns the command for a pointer position. `isOnSurface`: whether Shift is pressed.
 *
 * @param {Page} page
 * @param {LightHandle} handle
 * @param {Pixel} from
 * @returns {(pixel: Pixel, isOnSurface: boolean) => Command | null}
 */
export function lightDrag(page, handle, from) {
  const { camera, up } = page.openScene();
  if (handle.kind === "shadow") {
    const { light, object } = handle.shadow;
    return (pixel) => ({ do: "aim-sun", light: light.id, object, to: pixel });
  }
  if (handle.kind === "arrow") {
    const { light, anchor_m } = handle.of;
    const axis = levelAxes(up)[handle.name];
    const [place, start] = [placeOf(light), alongAxis(camera, from, anchor_m, axis)];
    return (pixel) => {
      const now = alongAxis(camera, pixel, anchor_m, axis);
      return place && now !== null && start !== null ? movedTo(light, add(place, times(axis, now - start))) : null;
    };
  }
  const { light, at } = handle.mark;
  const place = placeOf(light);
  return ([u, v], isOnSurface) => {
    /** @type {Pixel} */
    const pixel = [u + at[0] - from[0], v + at[1] - from[1]];
    if (!place) return { do: "turn-sun", light: light.id, ...sunAngles(direction(camera, pixel), levelAxes(up)) };
    if (isOnSurface) return { do: "drag-light", light: light.id, to: pixel };
    return movedTo(light, times(direction(camera, pixel), -place[2]));
  };
}

/**
 * Draws the lights. The context is translated to the photo's origin; `scale` is canvas pixels per photo pixel.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {number} rem Canvas pixels.
 * @param {PhotoLights} lights
 * @param {string | null} selectedId
 * @param {string | null} active Name of the handle that is being dragged.
 */
export function drawLights(context, scale, rem, { marks, selected, shadows }, selectedId, active) {
  for (const { light, top, tip } of shadows) {
    drawPath(context, scale, rem, [top, tip], "#ffe08a", 0.1 * rem, [0.5 * rem, 0.35 * rem]);
    drawMark(context, [tip[0] * scale, tip[1] * scale], rem, light, active === "shadow", `shadow in ${light.id}`);
  }
  for (const { light, at } of marks) drawMark(context, [at[0] * scale, at[1] * scale], rem, light, light.id === selectedId, light.id);
  if (selected) drawArrows(context, scale, rem, selected.arrows, active);
}

/** @type {(context: CanvasRenderingContext2D, at: Pixel, rem: number, light: LightView, isSelected: boolean, text: string) => void} */
function drawMark(context, [x, y], rem, light, isSelected, text) {
  const isOn = light.changed.on !== false;
  /** @type {(width: number, color: string) => void} */
  const stroke = (width, color) => {
    context.strokeStyle = color;
    context.lineWidth = width * rem;
    context.stroke();
  };
  context.setLineDash([]);
  context.lineCap = "round";
  context.beginPath();
  for (let ray = 0; isOn && ray < 8; ray++) {
    const [cos, sin] = [Math.cos((ray * Math.PI) / 4), Math.sin((ray * Math.PI) / 4)];
    context.moveTo(x + 0.62 * rem * cos, y + 0.62 * rem * sin);
    context.lineTo(x + 0.88 * rem * cos, y + 0.88 * rem * sin);
  }
  stroke(0.28, "#000a");
  stroke(0.13, colorOf(light));
  context.beginPath();
  context.arc(x, y, 0.42 * rem, 0, 2 * Math.PI);
  context.fillStyle = isOn ? colorOf(light) : "#1b1b1bc0";
  context.fill();
  stroke(0.22, "#000a");
  stroke(0.1, isOn ? "#fff" : "#9a9a9a");
  if (isSelected) {
    context.beginPath();
    context.arc(x, y, 1.1 * rem, 0, 2 * Math.PI);
    stroke(0.26, "#000a");
    stroke(0.13, "#f0a93b");
  }
  context.font = `${0.85 * rem}px system-ui, "DejaVu Sans", sans-serif`;
  context.textBaseline = "middle";
  context.lineJoin = "round";
  context.strokeStyle = "#000c";
  context.lineWidth = 0.22 * rem;
  // On the right of a selected light is an arrow.
  const [textX, textY] = isSelected ? [x - 1.3 * rem, y + 1.3 * rem] : [x + 1.25 * rem, y];
  context.strokeText(text, textX, textY);
  context.fillStyle = "#fff";
  context.fillText(text, textX, textY);
}
