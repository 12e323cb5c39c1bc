// Overlay lines of the view from outside: camera, floor grid, objects, lights and the probe.

import { add, complete, corners, cross, dot, minus, project, times, unit } from "./camera.js";
import { colorOf, placeOf } from "./light_marks.js";
import { EDGES } from "./handles.js";
import { cameraOf, inFrame, levelAxes } from "./orbit.js";
import { shownAt } from "./outside_lights.js";

/** @import { Pixel, Vector } from "./camera.js" */
/** @import { LevelAxes, Viewpoint } from "./orbit.js" */
/** @import { LightView, ObjectView, RoomExtent, SceneInfo } from "./protocol.d.ts" */
/** @import { Page } from "./store.js" */

/** @typedef {{ dash?: number[], isPlain?: boolean }} LineOptions */
/** @typedef {CanvasImageSource & { width: number, height: number }} SizedImage */

/** Lines are clipped this near to the viewer. */
const NEAR_M = 0.02;

/**
 * Draws all lines of `page` over the image of a view; `image` is the photo, or null, `probe` the probe's position, or
 * null.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {Viewpoint} view
 * @param {Page} page
 * @param {SizedImage | null} image
 * @param {Vector | null} probe
 */
export function drawLines(context, view, page, image, probe) {
  const scene = page.openScene();
  const pen = new Pen(context, view, scene.up);
  const level = levelAxes(scene.up);
  drawGrid(pen, scene.extent, level);
  drawFrustum(pen, scene, image);
  drawPlumb(pen, scene.extent, level);
  for (const light of page.view?.lights ?? []) drawLight(pen, light, scene.extent, light.id === page.selectedLight);
  for (const object of page.view?.objects ?? []) drawObject(pen, object, page.isSelected(object.id));
  if (probe) drawProbe(pen, probe);
  drawAxes(pen, level);
}

/** Draws world-space points onto a canvas that shows the image of a view. */
class Pen {
  /**
   * @param {CanvasRenderingContext2D} context
   * @param {Viewpoint} view
   * @param {Vector} up
   */
  constructor(context, view, up) {
    const { canvas } = context;
    this.context = context;
    this.camera = cameraOf(view, up);
    this.scale = [canvas.width / view.width, canvas.height / view.height];
    this.rem = parseFloat(getComputedStyle(document.documentElement).fontSize) * devicePixelRatio;
  }

  /**
   * Returns the canvas position of a point; null behind the viewer.
   *
   * @param {Vector} point
   */
  at(point) {
    return this.projected(inFrame(this.camera, point));
  }

  /**
   * Returns the canvas position of a point in the viewer's frame; null behind the viewer.
   *
   * @param {Vector} inView
   * @returns {Pixel | null}
   */
  projected(inView) {
    const pixel = project(this.camera, inView);
    return pixel && [pixel[0] * this.scale[0], pixel[1] * this.scale[1]];
  }

  /**
   * Draws a polyline, clipped to the front of the viewer; `width` and `dash` in rem.
   *
   * @param {Vector[]} points
   * @param {string} color
   * @param {number} width
   * @param {LineOptions} [options]
   */
  line(points, color, width, { dash = [], isPlain = false } = {}) {
    const { context, rem } = this;
    context.beginPath();
    const inView = points.map((point) => inFrame(this.camera, point));
    for (let i = 1; i < inView.length; i++) {
      const ends = clippedNear(inView[i - 1], inView[i]);
      const [start, end] = ends?.map((point) => this.projected(point)) ?? [];
      if (!start || !end) continue;
      context.moveTo(...start);
      context.lineTo(...end);
    }
    context.setLineDash(dash.map((length) => length * rem));
    context.lineCap = "round";
    if (!isPlain) {
      // A dark outline, visible on any background.
      context.strokeStyle = "#0009";
      context.lineWidth = (width + 0.1) * rem;
      context.stroke();
    }
    context.strokeStyle = color;
    context.lineWidth = width * rem;
    context.stroke();
    context.setLineDash([]);
  }

  /**
   * Draws a text next to a point; the offset is in rem.
   *
   * @param {Vector} point
   * @param {string} text
   * @param {string} color
   * @param {[number, number]} [offset]
   */
  label(point, text, color, [right, down] = [0.5, -0.5]) {
    const at = this.at(point);
    if (at) this.text([at[0] + right * this.rem, at[1] + down * this.rem], text, color);
  }

  /** @type {(at: Pixel, text: string, color: string) => void} */
  text(at, text, color) {
    const { context, rem } = this;
    context.font = `${0.85 * rem}px system-ui, "DejaVu Sans", sans-serif`;
    context.textBaseline = "middle";
    context.lineJoin = "round";
    context.strokeStyle = "#000c";
    context.lineWidth = 0.22 * rem;
    context.strokeText(text, ...at);
    context.fillStyle = color;
    context.fillText(text, ...at);
  }

  /** @type {(point: Vector, radius: number, color: string) => void} */
  dot(point, radius, color) {
    const at = this.at(point);
    if (!at) return;
    const { context, rem } = this;
    context.beginPath();
    context.arc(...at, radius * rem, 0, 2 * Math.PI);
    context.fillStyle = color;
    context.fill();
    context.strokeStyle = "#000b";
    context.lineWidth = 0.1 * rem;
    context.stroke();
  }

  /** @type {(point: Vector, radius: number, color: string) => void} */
  circle(point, radius, color) {
    const at = this.at(point);
    if (!at) return;
    const { context, rem } = this;
    context.beginPath();
    context.arc(...at, radius * rem, 0, 2 * Math.PI);
    context.strokeStyle = color;
    context.lineWidth = 0.14 * rem;
    context.stroke();
  }

  /**
   * Draws a line with an arrowhead at its end.
   *
   * @param {Vector} from
   * @param {Vector} to
   * @param {string} color
   * @param {number} width
   * @param {LineOptions} [options]
   */
  arrow(from, to, color, width, options) {
    this.line([from, to], color, width, options);
    const [start, end] = [this.at(from), this.at(to)];
    if (!start || !end) return;
    const length = Math.hypot(end[0] - start[0], end[1] - start[1]);
    if (length < 2) return;
    const size = 0.55 * this.rem;
    const [dx, dy] = [((end[0] - start[0]) / length) * size, ((end[1] - start[1]) / length) * size];
    const { context } = this;
    context.beginPath();
    context.moveTo(end[0] + 0.4 * dx, end[1] + 0.4 * dy);
    context.lineTo(end[0] - dx - 0.5 * dy, end[1] - dy + 0.5 * dx);
    context.lineTo(end[0] - dx + 0.5 * dy, end[1] - dy - 0.5 * dx);
    context.closePath();
    context.strokeStyle = "#0009";
    context.lineWidth = 0.11 * this.rem;
    context.stroke();
    context.fillStyle = color;
    context.fill();
  }

  /**
   * Draws a circle in the room.
   *
   * @param {Vector} centre
   * @param {Vector} normal
   * @param {number} radius
   * @param {string} color
   * @param {number} width
   * @param {LineOptions} [options]
   */
  ring(centre, normal, radius, color, width, options) {
    const [x, y] = across(normal);
    /** @param {number} i */
    const point = (i) => add(centre, add(times(x, radius * Math.cos((i * Math.PI) / 24)), times(y, radius * Math.sin((i * Math.PI) / 24))));
    this.line(Array.from({ length: 49 }, (_, i) => point(i)), color, width, options);
  }

  /**
   * Returns the unit vector from a point to the viewer.
   *
   * @param {Vector} point
   */
  towards(point) {
    return unit(minus(this.camera.eye_m, point));
  }
}

/**
 * Clips a line to the front of the viewer, in the viewer's frame; null if nothing is left.
 *
 * @type {(a: Vector, b: Vector) => [Vector, Vector] | null}
 */
export function clippedNear(a, b) {
  const [near, far] = a[2] > b[2] ? [a, b] : [b, a];
  if (far[2] > -NEAR_M) return null;
  if (near[2] <= -NEAR_M) return [a, b];
  const share = (-NEAR_M - far[2]) / (near[2] - far[2]);
  return [far, add(far, times(minus(near, far), share))];
}

/**
 * Returns two unit vectors orthogonal to a third one and to each other.
 *
 * @type {(normal: Vector) => [Vector, Vector]}
 */
export function across(normal) {
  const least = normal.map(Math.abs).indexOf(Math.min(...normal.map(Math.abs)));
  const x = unit(cross(normal, [Number(least === 0), Number(least === 1), Number(least === 2)]));
  return [x, cross(normal, x)];
}

/**
 * Draws the floor grid in metres, from below the photo's camera.
 *
 * @type {(pen: Pen, extent: RoomExtent, axes: LevelAxes) => void}
 */
function drawGrid(pen, { middle_m, radius_m, floor_m }, { right, up, ahead }) {
  /** @type {(x: number, z: number) => Vector} */
  const on = (x, z) => add(times(up, floor_m), add(times(right, x), times(ahead, z)));
  const reach = Math.min(Math.ceil(0.8 * radius_m), 20);
  const [x, z] = [right, ahead].map((axis) => Math.round(dot(middle_m, axis)));
  for (let i = -reach; i <= reach; i++) {
    for (const ends of [[on(x + i, z - reach), on(x + i, z + reach)], [on(x - reach, z + i), on(x + reach, z + i)]]) {
      pen.line(ends, "#00000048", 0.14, { isPlain: true });
      pen.line(ends, "#ffffff60", 0.06, { isPlain: true });
    }
  }
  for (let i = 1; i <= z + reach; i++) pen.label(on(0, i), `${i} m`, "#c8c8c8", [0.3, 0]);
}

/**
 * Draws the photo's frustum, with the photo in it.
 *
 * @type {(pen: Pen, scene: SceneInfo, image: SizedImage | null) => void}
 */
function drawFrustum(pen, { camera, extent }, image) {
  /** @type {(s: number, t: number, depth: number) => Vector} */
  const at = (s, t, depth) => [
    ((s * camera.width - camera.cx) / camera.fx) * depth,
    (-(t * camera.height - camera.cy) / camera.fy) * depth,
    -depth,
  ];
  const depth = 0.16 * extent.radius_m;
  const ends = [[0, 0], [1, 0], [1, 1], [0, 1]];
  for (const [s, t] of ends) pen.line([at(s, t, depth), at(s, t, 1.4 * extent.radius_m)], "#f0a93b", 0.07);
  if (image) drawImageOn(pen, image, (s, t) => at(s, t, depth));
  for (const [s, t] of ends) pen.line([[0, 0, 0], at(s, t, depth)], "#f0a93b", 0.15);
  pen.line([...ends, ends[0]].map(([s, t]) => at(s, t, depth)), "#f0a93b", 0.15);
  pen.dot([0, 0, 0], 0.25, "#f0a93b");
  pen.label([0, 0, 0], "camera", "#f0a93b", [-4, 0]);
}

/**
 * Draws an image on a rectangle in the room, in affine tiles that approximate perspective.
 *
 * @type {(pen: Pen, image: SizedImage, point: (s: number, t: number) => Vector) => void}
 */
function drawImageOn(pen, image, point) {
  const TILES = 8;
  const { context } = pen;
  const STRIDE = TILES + 1;
  const knot = (/** @type {number} */ index) => point((index % STRIDE) / TILES, Math.floor(index / STRIDE) / TILES);
  const knots = complete(Array.from({ length: STRIDE ** 2 }, (_, index) => pen.at(knot(index))));
  if (!knots) return;
  const [width, height] = [image.width / TILES, image.height / TILES];
  context.save();
  for (let j = 0; j < TILES; j++) {
    for (let i = 0; i < TILES; i++) {
      const [[x, y], [rightX, rightY], [belowX, belowY]] = [0, 1, STRIDE].map((step) => knots[j * STRIDE + i + step]);
      context.setTransform((rightX - x) / width, (rightY - y) / width, (belowX - x) / height, (belowY - y) / height, x, y);
      // One pixel of overlap, to avoid gaps.
      const [more, below] = [i + 1 < TILES ? 1 : 0, j + 1 < TILES ? 1 : 0];
      context.drawImage(image, i * width, j * height, width + more, height + below, 0, 0, width + more, height + below);
    }
  }
  context.restore();
}

/**
 * Draws the camera's height above the floor.
 *
 * @type {(pen: Pen, extent: RoomExtent, axes: LevelAxes) => void}
 */
function drawPlumb(pen, { floor_m }, { up }) {
  if (floor_m >= 0) return;
  const foot = times(up, floor_m);
  pen.line([[0, 0, 0], foot], "#f0a93b", 0.1, { dash: [0.3, 0.3] });
  pen.dot(foot, 0.14, "#f0a93b");
  pen.label(times(foot, 0.5), `${(-floor_m).toFixed(2)} m`, "#f0a93b", [0.5, 0]);
}

/** @type {(pen: Pen, object: ObjectView, isSelected: boolean) => void} */
function drawObject(pen, object, isSelected) {
  const box = corners(object);
  const color = isSelected ? "#f0a93b" : "#ffffff";
  for (const [a, b] of EDGES) pen.line([box[a], box[b]], color, 0.11);
  pen.label(times([4, 5, 6, 7].map((i) => box[i]).reduce(add), 1 / 4), object.name, color, [-0.5, -0.9]);
}

/**
 * Draws a light: a ring of its area with an arrow to where it shines, or the arrow of a sun; dashed if it is off.
 *
 * @type {(pen: Pen, light: LightView, extent: RoomExtent, isSelected: boolean) => void}
 */
function drawLight(pen, light, extent, isSelected) {
  const isOn = light.changed.on ?? true;
  const color = colorOf(light);
  const options = { dash: isOn ? [] : [0.25, 0.25] };
  const shown = shownAt(light, extent);
  if (!shown) return;
  if (isSelected) pen.circle(shown, 0.75, "#f0a93b");
  if (light.kind === "sun" && light.direction) {
    pen.arrow(shown, add(extent.middle_m, times(light.direction, 0.6 * extent.radius_m)), color, 0.16, options);
    pen.dot(shown, 0.45, color);
    pen.label(shown, light.id, color, [0.8, 0]);
    return;
  }
  const at = placeOf(light);
  if (!at) return;
  const radius = light.radius_m ?? Math.sqrt(Math.max(light.area_m2 ?? 0, 0) / Math.PI);
  pen.ring(at, light.direction ?? pen.towards(at), radius, color, 0.09, options);
  if (light.direction) pen.arrow(at, add(at, times(light.direction, Math.max(0.3, 0.8 * radius))), color, 0.09, options);
  pen.dot(at, 0.28, color);
  pen.label(at, light.id, color);
}

/** @type {(pen: Pen, position: Vector) => void} */
function drawProbe(pen, position) {
  pen.ring(position, pen.towards(position), 0.1, "#56b4e9", 0.1);
  pen.dot(position, 0.14, "#56b4e9");
  pen.label(position, "probe", "#56b4e9", [0.5, 1]);
}

/**
 * Draws the up, right and ahead axes of the photo's camera in the corner.
 *
 * @type {(pen: Pen, axes: LevelAxes) => void}
 */
function drawAxes(pen, { right, up, ahead }) {
  const { context, rem } = pen;
  /** @type {Pixel} */
  const centre = [context.canvas.width - 4.6 * rem, 4.6 * rem];
  context.beginPath();
  context.arc(...centre, 3.9 * rem, 0, 2 * Math.PI);
  context.fillStyle = "#1b1b1bb0";
  context.fill();
  /** @type {(name: string, axis: Vector, color: string) => { name: string, color: string, inView: number[] }} */
  const inView = (name, axis, color) => ({ name, color, inView: pen.camera.axes.map((own) => dot(own, axis)) });
  const named = [inView("right", right, "#e0705f"), inView("up", up, "#8fce6a"), inView("ahead", ahead, "#7aa7ea")];
  // Farthest first.
  for (const { name, color, inView: [x, y] } of named.sort((a, b) => a.inView[2] - b.inView[2])) {
    /** @type {Pixel} */
    const end = [centre[0] + 2 * rem * x, centre[1] - 2 * rem * y];
    context.beginPath();
    context.moveTo(...centre);
    context.lineTo(...end);
    context.strokeStyle = color;
    context.lineWidth = 0.16 * rem;
    context.stroke();
    context.textAlign = "center";
    pen.text([centre[0] + 2.6 * rem * x, centre[1] - 2.6 * rem * y], name, color);
    context.textAlign = "start";
  }
}
