// Dragging lights in the view of the room from outside.

import { add, alongAxis, direction, dot, minus, project, times, unit } from "./camera.js";
import { movedTo, placeOf, sunAngles } from "./light_marks.js";
import { inFrame, levelAxes } from "./orbit.js";

/** @import { Pixel, Vector } from "./camera.js" */
/** @import { OutsideCamera } from "./orbit.js" */
/** @import { Command, LightView, RoomExtent } from "./protocol.d.ts" */

/** A sun is drawn at this multiple of the room's radius; a light is not moved farther from its middle. */
export const SUN_RADII = 1.1;
const MAX_RADII = 3;

/**
 * Returns where a light is drawn, metres; null if it is nowhere.
 *
 * @type {(light: LightView, extent: RoomExtent) => Vector | null}
 */
export function shownAt(light, { middle_m, radius_m }) {
  if (light.kind !== "sun") return placeOf(light);
  return light.direction ? add(middle_m, times(light.direction, SUN_RADII * radius_m)) : null;
}

/**
 * Returns the nearest light to a position in the view, or null. `reach` in pixels of the view.
 *
 * @type {(camera: OutsideCamera, lights: LightView[], extent: RoomExtent, at: Pixel, reach: number) => LightView | null}
 */
export function roomLightAt(camera, lights, extent, at, reach) {
  const near = lights.flatMap((light) => {
    const place = shownAt(light, extent);
    const seen = place && project(camera, inFrame(camera, place));
    const distance = seen ? Math.hypot(seen[0] - at[0], seen[1] - at[1]) : Infinity;
    return distance <= reach ? [{ light, distance }] : [];
  });
  return near.sort((a, b) => a.distance - b.distance)[0]?.light ?? null;
}

/**
 * Returns the world direction through a position in the view.
 *
 * @type {(camera: OutsideCamera, at: Pixel) => Vector}
 */
export function rayOf(camera, at) {
  const [x, y, z] = direction(camera, at);
  return unit(add(add(times(camera.axes[0], x), times(camera.axes[1], y)), times(camera.axes[2], z)));
}

/**
 * Returns where the ray through a position in the view meets the level plane through a point; null if it does not.
 *
 * @type {(camera: OutsideCamera, at: Pixel, point: Vector, up: Vector) => Vector | null}
 */
export function onLevel(camera, at, point, up) {
  const ray = rayOf(camera, at);
  const distance = dot(minus(point, camera.eye_m), up) / dot(ray, up);
  return Number.isFinite(distance) && distance > 0 ? add(camera.eye_m, times(ray, distance)) : null;
}

/**
 * Returns the point of a sphere that is nearest to the ray through a position in the view, on the viewer's side.
 *
 * @type {(camera: OutsideCamera, at: Pixel, middle: Vector, radius: number) => Vector}
 */
export function onSphere(camera, at, middle, radius) {
  const ray = rayOf(camera, at);
  const from = minus(camera.eye_m, middle);
  const half = dot(from, ray);
  const under = half * half - dot(from, from) + radius * radius;
  const nearest = add(camera.eye_m, times(ray, -half - Math.sqrt(Math.max(under, 0))));
  return add(middle, times(unit(minus(nearest, middle)), radius));
}

/**
 * Starts to drag a light; returns the command for a position in the view: at its height, or with Shift up and down; a
 * sun turns around the room.
 *
 * @param {OutsideCamera} camera
 * @param {Vector} up
 * @param {RoomExtent} extent
 * @param {LightView} light
 * @param {Pixel} from
 * @returns {(at: Pixel, isUpright: boolean) => Command | null}
 */
export function roomLightDrag(camera, up, extent, light, from) {
  const { middle_m, radius_m } = extent;
  if (light.kind === "sun") {
    const level = levelAxes(up);
    return (at) => {
      const towards = minus(onSphere(camera, at, middle_m, SUN_RADII * radius_m), middle_m);
      return { do: "turn-sun", light: light.id, ...sunAngles(towards, level) };
    };
  }
  const place = placeOf(light);
  if (!place) return () => null;
  const [pointInView, upInView] = [inFrame(camera, place), /** @type {Vector} */ (camera.axes.map((axis) => dot(axis, up)))];
  const [levelStart, heightStart] = [onLevel(camera, from, place, up), alongAxis(camera, from, pointInView, upInView)];
  return (at, isUpright) => {
    const height = isUpright ? alongAxis(camera, at, pointInView, upInView) : null;
    const level = isUpright ? null : onLevel(camera, at, place, up);
    const by = height !== null && heightStart !== null ? times(up, height - heightStart)
      : level && levelStart ? minus(level, levelStart) : null;
    const moved = by && add(place, by);
    return moved && Math.hypot(...minus(moved, middle_m)) <= MAX_RADII * radius_m ? movedTo(light, moved) : null;
  };
}
