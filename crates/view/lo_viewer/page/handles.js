// Drawings over the photo: the selected object's handles in perspective (box, rotation ring, lift arrow, scale corner),
// and the white pixel.

import { add, axes, complete, corners, project, times } from "./camera.js";

/** @import { Box, Lens, Pixel, Vector } from "./camera.js" */

/** @typedef {"lift" | "turn" | "size"} Handle */
/** @typedef {{ lift: Pixel, turn: Pixel, size: Pixel, top: Pixel, ring: Pixel[], box: Pixel[] }} Handles Photo positions. */

/** @type {Handle[]} */
const HANDLES = ["lift", "turn", "size"];

/** Radius of the ring as a multiple of the base's half diagonal. */
const RING = 1.15;

/**
 * Projects an object's handles to photo positions; null if any is behind the camera.
 *
 * @type {(camera: Lens, object: Box) => Handles | null}
 */
export function handlesOf(camera, object) {
  const [x, up, z] = axes(object);
  const [width, height, length] = object.size_m;
  const radius = (RING * Math.hypot(width, length)) / 2;
  const rise = Math.max(0.35 * height, 0.5 * radius);
  const top = add(object.position_m, times(up, height));
  /** @type {(angle: number) => Vector} */
  const onRing = (angle) => add(object.position_m, add(times(x, radius * Math.sin(angle)), times(z, radius * Math.cos(angle))));
  const ring = Array.from({ length: 49 }, (_, i) => onRing((2 * Math.PI * i) / 48));
  const points = [top, add(top, times(up, rise)), object.position_m, ...ring, ...corners(object)];
  const projected = complete(points.map((point) => project(camera, point)));
  if (!projected) return null;
  const box = projected.slice(-8);
  return { top: projected[0], lift: projected[1], turn: projected[3], size: box[6], ring: projected.slice(3, -8), box };
}

/** Edges of a box, as indices of its corners. */
export const EDGES = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

/**
 * Draws the handles of the selected object and the box of the hovered one; `scale` is canvas pixels per photo pixel.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {number} rem
 * @param {Lens} camera
 * @param {Box | null} selected
 * @param {Box | null} hovered
 * @param {string | null} active Name of the handle that is being dragged.
 */
export function drawHandles(context, scale, rem, camera, selected, hovered, active) {
  const { canvas } = context;
  context.clearRect(0, 0, canvas.width, canvas.height);
  /** @type {(pixel: Pixel) => Pixel} */
  const at = ([u, v]) => [u * scale, v * scale];
  /** @type {(points: Pixel[], color: string, width: number) => void} */
  const line = (points, color, width) => {
    context.beginPath();
    points.forEach((point, i) => (i ? context.lineTo(...at(point)) : context.moveTo(...at(point))));
    // A dark outline, visible on any background.
    context.setLineDash([]);
    context.strokeStyle = "#000a";
    context.lineWidth = width + 0.14 * rem;
    context.stroke();
    context.strokeStyle = color;
    context.lineWidth = width;
    context.stroke();
  };
  /** @type {(point: Pixel, name: Handle) => void} */
  const knob = (point, name) => {
    const isActive = active === name;
    context.setLineDash([]);
    context.beginPath();
    context.arc(...at(point), (isActive ? 0.55 : 0.42) * rem, 0, 2 * Math.PI);
    context.fillStyle = isActive ? "#fff" : "#f0a93b";
    context.fill();
    context.strokeStyle = "#000";
    context.lineWidth = 0.1 * rem;
    context.stroke();
  };
  /** @type {(box: Pixel[], color: string) => void} */
  const outline = (box, color) => EDGES.forEach(([a, b]) => line([box[a], box[b]], color, 0.07 * rem));
  if (hovered && hovered !== selected) {
    const handles = handlesOf(camera, hovered);
    if (handles) outline(handles.box, "#ffffffb0");
  }
  const handles = selected && handlesOf(camera, selected);
  if (!handles) return;
  outline(handles.box, "#f0a93b90");
  line(handles.ring, "#f0a93b", 0.13 * rem);
  line([handles.top, handles.lift], "#f0a93b", 0.13 * rem);
  /** @type {(to: Pixel, from: Pixel) => void} */
  const arrow = ([u, v], [fromU, fromV]) => {
    const length = Math.max(Math.hypot(u - fromU, v - fromV), 1e-6);
    const size = ((active === "lift" ? 0.7 : 0.55) * rem) / scale;
    const [du, dv] = [((u - fromU) / length) * size, ((v - fromV) / length) * size];
    context.setLineDash([]);
    context.beginPath();
    context.lineTo(...at([u + du, v + dv]));
    context.lineTo(...at([u - du - 0.9 * dv, v - dv + 0.9 * du]));
    context.lineTo(...at([u - du + 0.9 * dv, v - dv - 0.9 * du]));
    context.closePath();
    context.fillStyle = active === "lift" ? "#fff" : "#f0a93b";
    context.fill();
    context.strokeStyle = "#000";
    context.lineWidth = 0.1 * rem;
    context.stroke();
  };
  knob(handles.turn, "turn");
  arrow(handles.lift, handles.top);
  knob(handles.size, "size");
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

/**
 * Returns the name of the handle at a photo position, or null; `reach` in photo pixels.
 *
 * @type {(camera: Lens, object: Box, pixel: Pixel, reach: number) => Handle | null}
 */
export function handleAt(camera, object, [u, v], reach) {
  const handles = handlesOf(camera, object);
  if (!handles) return null;
  const near = HANDLES
    .map((name) => ({ name, distance: Math.hypot(handles[name][0] - u, handles[name][1] - v) }))
    .filter(({ distance }) => distance <= reach)
    .sort((a, b) => a.distance - b.distance);
  return near[0]?.name ?? null;
}
