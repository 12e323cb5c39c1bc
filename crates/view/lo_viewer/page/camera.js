// Vectors and projection. The camera is at the origin and looks along −Z; +Y is up; metres.

/** @import { ObjectView } from "./protocol.d.ts" */

/** @typedef {[number, number]} Pixel Position in an image, pixels. */
/** @typedef {[number, number, number]} Vector */
/** @typedef {{ fx: number, fy: number, cx: number, cy: number }} Lens Focal lengths and principal point, pixels. */
/** @typedef {Pick<ObjectView, "position_m" | "up" | "yaw_deg" | "size_m">} Box An object's position and extent. */

/** @type {(a: Vector, b: Vector) => Vector} */
export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
/** @type {(a: Vector, b: Vector) => Vector} */
export const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
/** @type {(a: Vector, s: number) => Vector} */
export const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
/** @type {(a: Vector, b: Vector) => number} */
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/** @type {(a: Vector, b: Vector) => Vector} */
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/** @type {(a: Vector) => Vector} */
export const unit = (a) => times(a, 1 / Math.hypot(...a));

/**
 * Projects a point to a photo position; null at or behind the camera.
 *
 * @type {(camera: Lens, point: Vector) => Pixel | null}
 */
export function project(camera, [x, y, z]) {
  if (z > -1e-3) return null;
  return [camera.cx - (camera.fx * x) / z, camera.cy + (camera.fy * y) / z];
}

/**
 * Returns the direction through a photo position, with z = −1.
 *
 * @type {(camera: Lens, pixel: Pixel) => Vector}
 */
export function direction(camera, [u, v]) {
  return [(u - camera.cx) / camera.fx, -(v - camera.cy) / camera.fy, -1];
}

/**
 * Intersects the ray through a photo position with a plane; null without intersection.
 *
 * @type {(camera: Lens, pixel: Pixel, point: Vector, normal: Vector) => Vector | null}
 */
export function onPlane(camera, pixel, point, normal) {
  const along = direction(camera, pixel);
  const distance = dot(point, normal) / dot(along, normal);
  return Number.isFinite(distance) && distance > 0 ? times(along, distance) : null;
}

/**
 * Returns how far along an axis from a point the ray through a photo position passes nearest to it, metres; null if
 * both run in nearly the same direction.
 *
 * @type {(camera: Lens, pixel: Pixel, point: Vector, axis: Vector) => number | null}
 */
export function alongAxis(camera, pixel, point, axis) {
  const ray = unit(direction(camera, pixel));
  const across = 1 - dot(ray, axis) ** 2;
  if (across < 1e-3) return null;
  const distance = (dot(ray, point) - dot(axis, point) * dot(ray, axis)) / across;
  return distance > 0 ? distance * dot(ray, axis) - dot(axis, point) : null;
}

/**
 * Returns an object's x, y and z axes in world space.
 *
 * @type {(object: Box) => [Vector, Vector, Vector]}
 */
export function axes(object) {
  const up = object.up;
  // The shortest rotation from +Y to `up`, after the rotation about the up axis.
  const axis = cross([0, 1, 0], up);
  const [sin, cos] = [Math.hypot(...axis), up[1]];
  /** @type {(v: Vector) => Vector} */
  const turned = (v) => {
    if (sin < 1e-6) return cos > 0 ? v : [v[0], -v[1], -v[2]];
    const k = times(axis, 1 / sin);
    return add(add(times(v, cos), times(cross(k, v), sin)), times(k, dot(k, v) * (1 - cos)));
  };
  const yaw = (object.yaw_deg * Math.PI) / 180;
  return [
    turned([Math.cos(yaw), 0, -Math.sin(yaw)]),
    up,
    turned([Math.sin(yaw), 0, Math.cos(yaw)]),
  ];
}

/**
 * Returns the eight corners of an object's bounding box, those of the base first.
 *
 * @type {(object: Box) => Vector[]}
 */
export function corners(object) {
  const [x, y, z] = axes(object);
  const [width, height, length] = object.size_m;
  const found = [];
  for (const h of [0, height]) {
    for (const [a, b] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
      const flat = add(times(x, (a * width) / 2), times(z, (b * length) / 2));
      found.push(add(add(object.position_m, flat), times(y, h)));
    }
  }
  return found;
}

/**
 * Returns the items; null if one of them is null.
 *
 * @template Item
 * @param {(Item | null)[]} items
 * @returns {Item[] | null}
 */
export function complete(items) {
  const present = items.filter((item) => item !== null);
  return present.length === items.length ? present : null;
}

/**
 * Returns whether a point is inside the convex hull of other points.
 *
 * @type {(points: Pixel[], point: Pixel) => boolean}
 */
export function isInHull(points, [x, y]) {
  // The point is inside unless all others are on one side of it.
  const angles = points.map(([px, py]) => Math.atan2(py - y, px - x)).sort((a, b) => a - b);
  let gap = 2 * Math.PI - (angles[angles.length - 1] - angles[0]);
  for (let i = 1; i < angles.length; i++) gap = Math.max(gap, angles[i] - angles[i - 1]);
  return gap < Math.PI;
}
