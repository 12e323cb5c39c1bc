// Drawings over the photo: the selected object's box, arrows, ring and corner, its drop line, and the white pixel.

import { add, axes, complete, corners, direction, minus, dot, project, times } from "./camera.js";
import { short } from "./dom.js";

/** @import { Box, Lens, Pixel, Vector } from "./camera.js" */
/** @import { LevelAxes } from "./orbit.js" */

/** @typedef {"right" | "up" | "ahead" | "turn" | "size"} Handle */
/** @typedef {{ left: number, top: number, right: number, bottom: number }} Rect Part of the photo, pixels. */
/** @typedef {{ name: "right" | "up" | "ahead", from: Pixel, to: Pixel }} Arrow Photo positions. */

/**
 * The handles of an object; photo positions unless noted.
 *
 * @typedef {object} Gizmo
 * @property {Vector} anchor_m Where the arrows begin, metres: the object's middle, or the visible point nearest to it.
 * @property {Vector} ring_m Centre of the ring, metres.
 * @property {Arrow[]} arrows
 * @property {Pixel[]} ring
 * @property {Pixel} size
 * @property {Pixel[] | null} box Null if it reaches behind the camera.
 */

/** Radius of the ring as a multiple of the base's half diagonal, and its least and largest radius, rem. */
const RING = 1.15;
const RING_REM = [2.4, 9];
/** Beginning and end of an arrow, rem from the anchor. */
const ARROW_REM = [0.9, 4.6];
/** Largest factor by which a foreshortened arrow is lengthened. */
const MAX_STRETCH = 4;

/** @type {Record<Handle, string>} */
const COLORS = { right: "#ff7b72", up: "#7ee787", ahead: "#79b8ff", turn: "#f0a93b", size: "#f0a93b" };

/**
 * Returns the nearest position in a part of the photo, with a distance from its border.
 *
 * @type {(pixel: Pixel, rect: Rect, inset: number) => Pixel}
 */
export const inside = ([u, v], { left, top, right, bottom }, inset) => [
  Math.min(Math.max(u, left + inset), Math.max(right - inset, left + inset)),
  Math.min(Math.max(v, top + inset), Math.max(bottom - inset, top + inset)),
];

/**
 * Returns the handles of an object, all of them in the visible part of the photo; null if its middle is behind the
 * camera. `rem` in photo pixels.
 *
 * @type {(camera: Lens, object: Box, level: LevelAxes, visible: Rect, rem: number) => Gizmo | null}
 */
export function gizmoOf(camera, object, level, visible, rem) {
  const [x, up, z] = axes(object);
  const [width, height, length] = object.size_m;
  const middle = add(object.position_m, times(up, height / 2));
  const seen = project(camera, middle);
  if (!seen) return null;
  const at = inside(seen, visible, 3 * rem);
  const isMoved = at[0] !== seen[0] || at[1] !== seen[1];
  const depth = -middle[2];
  const anchor_m = isMoved ? times(direction(camera, at), depth) : middle;
  const rem_m = (rem * depth) / camera.fx;
  /** @type {Arrow[]} */
  const arrows = [];
  for (const name of /** @type {const} */ (["right", "up", "ahead"])) {
    const unit = project(camera, add(anchor_m, times(level[name], rem_m)));
    const seenLength = unit ? Math.hypot(unit[0] - at[0], unit[1] - at[1]) : 0;
    if (seenLength < 1e-6) continue;
    const metres = rem_m * Math.min(Math.max(rem / seenLength, 1), MAX_STRETCH);
    /** @type {(length: number) => (Pixel | null)[]} */
    const ends = (length) => ARROW_REM.map((rems) => project(camera, add(anchor_m, times(level[name], length * rems * metres))));
    /** @param {Pixel | null} end */
    const isVisible = (end) => end !== null && String(inside(end, visible, 0)) === String(end);
    // Away from the camera, an arrow would cover the one up.
    const side = name === "ahead" ? -1 : 1;
    const lengths = [side, 0.5 * side, 0.25 * side, -side, -0.5 * side, -0.25 * side];
    const [from, to] = ends(lengths.find((each) => isVisible(ends(each)[1])) ?? side);
    // Seen from its end, an arrow has no direction on the photo.
    if (from && to && Math.hypot(to[0] - from[0], to[1] - from[1]) > 0.8 * rem) arrows.push({ name, from, to });
  }
  const ring_m = isMoved ? anchor_m : object.position_m;
  const radius = Math.min(Math.max((RING * Math.hypot(width, length)) / 2, RING_REM[0] * rem_m), RING_REM[1] * rem_m);
  /** @type {(angle: number) => Vector} */
  const onRing = (angle) => add(ring_m, add(times(x, radius * Math.sin(angle)), times(z, radius * Math.cos(angle))));
  const ring = complete(Array.from({ length: 49 }, (_, i) => project(camera, onRing((2 * Math.PI * i) / 48))));
  const box = complete(corners(object).map((corner) => project(camera, corner)));
  const size = inside(box ? box[6] : [at[0] + 2 * rem, at[1] - 2 * rem], visible, rem);
  return { anchor_m, ring_m, arrows, ring: ring ?? [], size, box };
}

/** Edges of a box, as indices of its corners. */
export const EDGES = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

/**
 * Returns the distance of a point from a segment.
 *
 * @type {(point: Pixel, from: Pixel, to: Pixel) => number}
 */
export function segmentDistance([u, v], [a, b], [c, d]) {
  const squared = (c - a) ** 2 + (d - b) ** 2;
  const share = squared > 0 ? Math.min(Math.max(((u - a) * (c - a) + (v - b) * (d - b)) / squared, 0), 1) : 0;
  return Math.hypot(u - a - share * (c - a), v - b - share * (d - b));
}

/**
 * Returns the name of the handle at a photo position, or null: arrows and the ring along their whole length, the corner
 * first. `reach` in photo pixels.
 *
 * @type {(gizmo: Gizmo | null, pixel: Pixel, reach: number) => Handle | null}
 */
export function handleAt(gizmo, pixel, reach) {
  if (!gizmo) return null;
  if (Math.hypot(gizmo.size[0] - pixel[0], gizmo.size[1] - pixel[1]) <= 0.8 * reach) return "size";
  const around = gizmo.ring.slice(1).map((point, i) => segmentDistance(pixel, gizmo.ring[i], point));
  return nearestWithin([...distances(gizmo.arrows, pixel), { name: /** @type {Handle} */ ("turn"), distance: Math.min(...around) }], reach);
}

/**
 * Returns the name of the arrow at a photo position, or null. `reach` in photo pixels.
 *
 * @type {(arrows: Arrow[], pixel: Pixel, reach: number) => Arrow["name"] | null}
 */
export const arrowAt = (arrows, pixel, reach) => nearestWithin(distances(arrows, pixel), reach);

/** @type {(arrows: Arrow[], pixel: Pixel) => { name: Arrow["name"], distance: number }[]} */
const distances = (arrows, pixel) => arrows.map(({ name, from, to }) => ({ name, distance: segmentDistance(pixel, from, to) }));

/**
 * @template Name
 * @param {{ name: Name, distance: number }[]} near
 * @param {number} reach
 */
function nearestWithin(near, reach) {
  const [nearest] = near.filter(({ distance }) => distance <= 0.6 * reach).sort((a, b) => a.distance - b.distance);
  return nearest?.name ?? null;
}

/**
 * Draws a polyline with a dark outline, visible on any background. `scale` is canvas pixels per photo pixel.
 *
 * @type {(context: CanvasRenderingContext2D, scale: number, rem: number, points: Pixel[], color: string, width: number, dash?: number[]) => void}
 */
export function drawPath(context, scale, rem, points, color, width, dash = []) {
  context.beginPath();
  points.forEach(([u, v], i) => (i ? context.lineTo(u * scale, v * scale) : context.moveTo(u * scale, v * scale)));
  context.setLineDash(dash);
  context.strokeStyle = "#000a";
  context.lineWidth = width + 0.14 * rem;
  context.stroke();
  context.strokeStyle = color;
  context.lineWidth = width;
  context.stroke();
  context.setLineDash([]);
}

/**
 * Draws the outline of an object's box.
 *
 * @type {(context: CanvasRenderingContext2D, scale: number, rem: number, box: Pixel[], color: string) => void}
 */
export function drawBox(context, scale, rem, box, color) {
  for (const [a, b] of EDGES) drawPath(context, scale, rem, [box[a], box[b]], color, 0.07 * rem);
}

/**
 * Draws arrows; `active` is the name of the one that is being dragged.
 *
 * @type {(context: CanvasRenderingContext2D, scale: number, rem: number, arrows: Arrow[], active: string | null) => void}
 */
export function drawArrows(context, scale, rem, arrows, active) {
  for (const { name, from, to } of arrows) {
    const color = active === name ? "#fff" : COLORS[name];
    drawPath(context, scale, rem, [from, to], color, 0.17 * rem);
    const length = Math.max(Math.hypot(to[0] - from[0], to[1] - from[1]), 1e-6);
    const size = ((active === name ? 0.65 : 0.55) * rem) / scale;
    const [du, dv] = [((to[0] - from[0]) / length) * size, ((to[1] - from[1]) / length) * size];
    const [u, v] = to;
    context.beginPath();
    context.moveTo((u + du) * scale, (v + dv) * scale);
    context.lineTo((u - du - 0.8 * dv) * scale, (v - dv + 0.8 * du) * scale);
    context.lineTo((u - du + 0.8 * dv) * scale, (v - dv - 0.8 * du) * scale);
    context.closePath();
    fill(context, color, rem);
  }
}

/**
 * Draws the handles of the selected object and the box of the hovered one. The context is translated to the photo's
 * origin; `scale` is canvas pixels per photo pixel.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {number} rem Canvas pixels.
 * @param {Gizmo | null} selected
 * @param {Gizmo | null} hovered
 * @param {string | null} active Name of the handle that is being dragged.
 */
export function drawHandles(context, scale, rem, selected, hovered, active) {
  /** @param {Handle} name */
  const color = (name) => (active === name ? "#fff" : COLORS[name]);
  if (hovered?.box) drawBox(context, scale, rem, hovered.box, "#ffffffb0");
  if (!selected) return;
  if (selected.box) drawBox(context, scale, rem, selected.box, "#f0a93b90");
  drawPath(context, scale, rem, selected.ring, color("turn"), (active === "turn" ? 0.2 : 0.13) * rem);
  drawArrows(context, scale, rem, selected.arrows, active);
  const half = (active === "size" ? 0.5 : 0.4) * rem;
  const [x, y] = selected.size.map((along) => along * scale);
  context.beginPath();
  context.rect(x - half, y - half, 2 * half, 2 * half);
  fill(context, color("size"), rem);
}

/** @type {(context: CanvasRenderingContext2D, color: string, rem: number) => void} */
function fill(context, color, rem) {
  context.setLineDash([]);
  context.fillStyle = color;
  context.fill();
  context.strokeStyle = "#000";
  context.lineWidth = 0.1 * rem;
  context.stroke();
}

/**
 * Returns the height of a point above the floor, metres.
 *
 * @type {(point: Vector, up: Vector, floor_m: number) => number}
 */
export const heightAboveFloor = (point, up, floor_m) => dot(point, up) - floor_m;

/**
 * Draws a line from an object in the air down to the floor, with its height.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {number} rem
 * @param {Lens} camera
 * @param {Vector} base
 * @param {Vector} up
 * @param {number} floor_m
 */
export function drawDropLine(context, scale, rem, camera, base, up, floor_m) {
  const height = heightAboveFloor(base, up, floor_m);
  const ends = complete([base, minus(base, times(up, height))].map((point) => project(camera, point)));
  if (height < 0.02 || !ends) return;
  const [[x, y], [floorX, floorY]] = ends.map(([u, v]) => [u * scale, v * scale]);
  for (const [color, width] of /** @type {const} */ ([["#000a", 0.26], ["#fff", 0.12]])) {
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(floorX, floorY);
    context.moveTo(floorX - 0.6 * rem, floorY);
    context.lineTo(floorX + 0.6 * rem, floorY);
    context.setLineDash([0.4 * rem, 0.3 * rem]);
    context.strokeStyle = color;
    context.lineWidth = width * rem;
    context.stroke();
  }
  context.setLineDash([]);
  const text = `${short(Math.round(100 * height) / 100)} m above the floor`;
  context.font = `${0.95 * rem}px system-ui, "DejaVu Sans", sans-serif`;
  context.textBaseline = "middle";
  context.lineJoin = "round";
  context.strokeStyle = "#000c";
  context.lineWidth = 0.25 * rem;
  context.strokeText(text, floorX + 0.9 * rem, floorY);
  context.fillStyle = "#fff";
  context.fillText(text, floorX + 0.9 * rem, floorY);
}

/**
 * Marks the white pixel.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {number} rem
 * @param {Pixel} pixel
 */
export function drawWhite(context, scale, rem, [u, v]) {
  /** @type {Pixel} */
  const centre = [u * scale, v * scale];
  /** @type {(radius: number, width: number, color: string) => void} */
  const ring = (radius, width, color) => {
    context.beginPath();
    context.arc(...centre, radius * rem, 0, 2 * Math.PI);
    context.strokeStyle = color;
    context.lineWidth = width * rem;
    context.stroke();
  };
  context.setLineDash([]);
  ring(0.5, 0.3, "#000b");
  ring(0.5, 0.14, "#fff");
  context.beginPath();
  context.arc(...centre, 0.1 * rem, 0, 2 * Math.PI);
  context.fillStyle = "#fff";
  context.fill();
}
