// The orbit camera of the view from outside. An orbit holds `target_m`, `yaw_deg`, `pitch_deg` and `distance_m`.

import { add, cross, dot, minus, times, unit } from "./camera.js";

export const FOV_DEG = 40;

const START = { yaw_deg: 28, pitch_deg: 32 };
const MAX_PITCH_DEG = 88;
const DISTANCES_M = [0.3, 100];
const MAX_TARGET_M = 100;

export const clamped = (value, least, most) => Math.min(Math.max(value, least), most);
const wrapped = (angle) => angle - 360 * Math.round(angle / 360);
const HALF_FOV_TAN = Math.tan((FOV_DEG * Math.PI) / 360);

/**
 * Returns the horizontal right, the up, and the horizontal ahead vector of the photo's camera; `up` is a unit vector.
 */
export function levelAxes(up) {
  const steep = up[2] > 0 ? [0, 1, 0] : [0, -1, 0];
  const flat = [[0, 0, -1], steep].map((ahead) => minus(ahead, times(up, dot(ahead, up))));
  const ahead = unit(flat.find((along) => Math.hypot(...along) > 1e-3));
  return { right: cross(ahead, up), up, ahead };
}

/**
 * Returns the viewpoint of an orbit: `yaw_deg` to the right of behind the photo's camera, `pitch_deg` above the target.
 */
export function eyeOf({ target_m, yaw_deg, pitch_deg, distance_m }, { right, up, ahead }) {
  const [yaw, pitch] = [(yaw_deg * Math.PI) / 180, (pitch_deg * Math.PI) / 180];
  const flat = add(times(right, Math.sin(yaw)), times(ahead, -Math.cos(yaw)));
  return add(target_m, times(add(times(flat, Math.cos(pitch)), times(up, Math.sin(pitch))), distance_m));
}

/** Returns the camera of a view, as defined by `OutsideView` in `lo_session`. */
export function cameraOf({ eye_m, target_m, fov_deg, width, height }, up) {
  const ahead = unit(minus(target_m, eye_m));
  const right = unit(cross(ahead, up));
  const focal = (0.5 * height) / Math.tan((fov_deg * Math.PI) / 360);
  return { eye_m, axes: [right, cross(right, ahead), times(ahead, -1)], fx: focal, fy: focal, cx: width / 2, cy: height / 2 };
}

/** Transforms a point to the frame of such a camera. */
export const inFrame = ({ eye_m, axes }, point) => axes.map((axis) => dot(axis, minus(point, eye_m)));

/** Creates the initial orbit, which shows the whole room. */
export function orbitAround({ middle_m, radius_m }) {
  return { ...START, target_m: middle_m, distance_m: clamped(radius_m / HALF_FOV_TAN, ...DISTANCES_M) };
}

/** Rotates an orbit, in degrees. */
export function rotate(orbit, yaw, pitch) {
  orbit.yaw_deg = wrapped(orbit.yaw_deg + yaw);
  orbit.pitch_deg = clamped(orbit.pitch_deg + pitch, -MAX_PITCH_DEG, MAX_PITCH_DEG);
}

/** Moves the target by shares of the image height; `worldUp` is the unit vector against gravity. */
export function pan(orbit, worldUp, right, up) {
  const view = { eye_m: eyeOf(orbit, levelAxes(worldUp)), target_m: orbit.target_m, fov_deg: FOV_DEG, width: 1, height: 1 };
  const [x, y] = cameraOf(view, worldUp).axes;
  const height_m = 2 * orbit.distance_m * HALF_FOV_TAN;
  const moved = add(orbit.target_m, add(times(x, right * height_m), times(y, up * height_m)));
  orbit.target_m = moved.map((along) => clamped(along, -MAX_TARGET_M, MAX_TARGET_M));
}

/** Scales the distance to the target. */
export function zoom(orbit, factor) {
  orbit.distance_m = clamped(orbit.distance_m * factor, ...DISTANCES_M);
}

/** Describes an orbit in words. */
export function inWords({ yaw_deg, pitch_deg, distance_m }) {
  const side = wrapped(yaw_deg);
  const degrees = (angle, positive, negative) => `${Math.round(Math.abs(angle))}° ${angle < 0 ? negative : positive}`;
  return `${degrees(side, "from the right", "from the left")}, ${degrees(pitch_deg, "from above", "from below")}, ${distance_m.toFixed(1)} m`;
}
