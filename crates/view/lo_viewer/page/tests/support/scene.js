// A scene with a camera of 90° and objects in it.

export const CAMERA = { fx: 320, fy: 320, cx: 320, cy: 240, width: 640, height: 480 };

/** A cube of 0.5 m, 2 m ahead of the camera and 0.5 m below it. */
export const CUBE = {
  id: 1, name: "cube", mesh: "builtin:cube", place: { position: [0, -0.5, -2] }, size: { height: 0.5 }, yaw_deg: 0, path: null,
  align: "gravity", material: null, is_hidden: false, is_locked: false, unit: "metres", metres_per_unit: 1, unit_is_stated: true, position_m: [0, -0.5, -2], up: [0, 1, 0], size_m: [0.5, 0.5, 0.5], scale: 1, rests: true, shadows: [],
};

/** A lamp that was added, 2 m ahead and 0.5 m above the camera. */
export const LAMP = {
  id: "A1", kind: "area", origin: "added", radiance: [4, 3, 2], position_m: [0, 0.5, -2], radius_m: 0.08, changed: {}, sun_deg: null,
};

/** An added sun ahead on the right, 45° above the horizon. */
export const SUN = {
  id: "A2", kind: "sun", origin: "added", radiance: [9, 9, 9], direction: [0.5, Math.SQRT1_2, -0.5], changed: {}, sun_deg: [45, 45],
};

export const SCENE = {
  scene: 1, camera: CAMERA, up: [0, 1, 0],
  extent: { middle_m: [0, 0, -2], radius_m: 3, floor_m: -1.4 }, predicted_depth: false, has_panorama: false, notes: [],
};

/** Asserts that two vectors are equal to a tolerance, by default 1e-9 for double precision. */
export function assertNear(actual, expected, tolerance = 1e-9) {
  const far = actual.length !== expected.length || actual.some((value, i) => !(Math.abs(value - expected[i]) <= tolerance));
  if (far) throw new Error(`[${actual}] differs from [${expected}] by more than ${tolerance}`);
}
