// The orbit camera of the view from outside. An orbit holds `target_m`, `yaw_deg`, `pitch_deg` and `distance_m`.

import { add, cross, dot, minus, times, unit } from "./camera.js";

/** @import { Lens, Vector } from "./camera.js" */
/** @import { OutsideView, RoomExtent } from "./protocol.d.ts" */

/** @typedef {{ target_m: Vector, yaw_deg: number, pitch_deg: number, distance_m: number }} Orbit */
/** @typedef {{ right: Vector, up: Vector, ahead: Vector }} LevelAxes */
/** @typedef {Lens & { eye_m: Vector, axes: [Vector, Vector, Vector] }} OutsideCamera */
/** @typedef {Pick<OutsideView, "eye_m" | "target_m" | "fov_deg" | "width" | "height">} Viewpoint */

export const FOV_DEG = 40;

const START = { yaw_deg: 28, pitch_deg: 32 };
const MAX_PITCH_DEG = 88;
/** @type {[number, number]} */
const DISTANCES_M = [0.3, 100];
const MAX_TARGET_M = 100;

/** @type {(value: number, least: number, most: number) => number} */
export const clamped = (value, least, most) => Math.min(Math.max(value, least), most);
/** @type {(angle: number) => number} */
const wrapped = (angle) => angle - 360 * Math.round(angle / 360);
const HALF_FOV_TAN = Math.tan((FOV_DEG * Math.PI) / 360);

/**
 * Returns the horizontal right, the up, and the horizontal ahead vector of the photo's camera; `up` is a unit vector.
 *
 * @type {(up: Vector) => LevelAxes}
 */
export function levelAxes(up) {
  /** @type {(ahead: Vector) => Vector} */
  const flat = (ahead) => minus(ahead, times(up, dot(ahead, up)));
  const level = flat([0, 0, -1]);
  const isSteep = Math.hypot(...level) <= 1e-3;
  const ahead = unit(isSteep ? flat([0, up[2] > 0 ? 1 : -1, 0]) : level);
  return { right: cross(ahead, up), up, ahead };
}

/**
 * Returns the viewpoint of an orbit: `yaw_deg` to the right of behind the photo's camera, `pitch_deg` above the target.
 *
 * @type {(orbit: Orbit, axes: LevelAxes) => Vector}
 */
export function eyeOf({ target_m, yaw_deg, pitch_deg, distance_m }, { right, up, ahead }) {
  const [yaw, pitch] = [(yaw_deg * Math.PI) / 180, (pitch_deg * Math.PI) / 180];
  const flat = add(times(right, Math.sin(yaw)), times(ahead, -Math.cos(yaw)));
  return add(target_m, times(add(times(flat, Math.cos(pitch)), times(up, Math.sin(pitch))), distance_m));
}

/**
 * Returns the camera of a view, as defined by `OutsideView` in `lo_session`.
 *
 * @type {(view: Viewpoint, up: Vector) => OutsideCamera}
 */
export function cameraOf({ eye_m, target_m, fov_deg, width, height }, up) {
  const ahead = unit(minus(target_m, eye_m));
  const right = unit(cross(ahead, up));
  const focal = (0.5 * height) / Math.tan((fov_deg * Math.PI) / 360);
  return { eye_m, axes: [right, cross(right, ahead), times(ahead, -1)], fx: focal, fy: focal, cx: width / 2, cy: height / 2 };
}

/**
 * Transforms a point to the frame of such a camera.
 *
 * @type {(camera: OutsideCamera, point: Vector) => Vector}
 */
export function inFrame({ eye_m, axes: [x, y, z] }, point) {
  const from = minus(point, eye_m);
  return [dot(x, from), dot(y, from), dot(z, from)];
}

/**
 * Creates the initial orbit, which shows the whole room.
 *
 * @type {(extent: Pick<RoomExtent, "middle_m" | "radius_m">) => Orbit}
 */
export function orbitAround({ middle_m, radius_m }) {
  return { ...START, target_m: middle_m, distance_m: clamped(radius_m / HALF_FOV_TAN, ...DISTANCES_M) };
}

/**
 * Rotates an orbit, in degrees.
 *
 * @type {(orbit: Orbit, yaw: number, pitch: number) => void}
 */
export function rotate(orbit, yaw, pitch) {
  orbit.yaw_deg = wrapped(orbit.yaw_deg + yaw);
  orbit.pitch_deg = clamped(orbit.pitch_deg + pitch, -MAX_PITCH_DEG, MAX_PITCH_DEG);
}

/**
 * Moves the target by shares of the image height; `worldUp` is the unit vector against gravity.
 *
 * @type {(orbit: Orbit, worldUp: Vector, right: number, up: number) => void}
 */
export function pan(orbit, worldUp, right, up) {
  const view = { eye_m: eyeOf(orbit, levelAxes(worldUp)), target_m: orbit.target_m, fov_deg: FOV_DEG, width: 1, height: 1 };
  const [x, y] = cameraOf(view, worldUp).axes;
  const height_m = 2 * orbit.distance_m * HALF_FOV_TAN;
  const moved = add(orbit.target_m, add(times(x, right * height_m), times(y, up * height_m)));
  /** @type {(along: number) => number} */
  const near = (along) => clamped(along, -MAX_TARGET_M, MAX_TARGET_M);
  orbit.target_m = [near(moved[0]), near(moved[1]), near(moved[2])];
}

/**
 * Scales the distance to the target.
 *
 * @type {(orbit: Orbit, factor: number) => void}
 */
export function zoom(orbit, factor) {
  orbit.distance_m = clamped(orbit.distance_m * factor, ...DISTANCES_M);
}

/**
 * Describes an orbit in words.
 *
 * @type {(orbit: Orbit) => string}
 */
export function inWords({ yaw_deg, pitch_deg, distance_m }) {
  const side = wrapped(yaw_deg);
  /** @type {(angle: number, positive: string, negative: string) => string} */
  const degrees = (angle, positive, negative) => `${Math.round(Math.abs(angle))}° ${angle < 0 ? negative : positive}`;
  return `${degrees(side, "from the right", "from the left")}, ${degrees(pitch_deg, "from above", "from below")}, ${distance_m.toFixed(1)} m`;
}
