// The room from outside: the program's picture of it, and over that, as lines, what looks, stands and shines in it.

import { add, corners, cross, dot, isInHull, minus, project, times, unit } from "./camera.js";
import { byId, hexFromLinear } from "./dom.js";
import { EDGES } from "./handles.js";
import { falseColour } from "./picture.js";

const FOV_DEG = 40;
const START = { yaw_deg: 28, pitch_deg: 32 };
const MAX_PITCH_DEG = 88;
const DISTANCES_M = [0.3, 100];
const MAX_TARGET_M = 100;

/** Longer side of pictures while the view moves, and the largest ones when it is still; pixels. */
const MOVING_SIDE = 640;
const STILL_SIZE = [1920, 1440];

/** The view is still when it has not moved for this long; an answer that takes longer than this is lost. */
const STILL_MS = 150;
const PATIENCE_MS = 3000;

/** Lines end this near before the viewer. */
const NEAR_M = 0.02;

const STAGE_LABEL = "The room from outside. Arrow keys turn the view, with Shift they move it; plus and minus go nearer and farther, Home resets; question mark lists all keys.";

/** Right, up and ahead of the photo's camera on the level, for a unit vector against gravity. */
export function levelAxes(up) {
  const steep = up[2] > 0 ? [0, 1, 0] : [0, -1, 0];
  const flat = [[0, 0, -1], steep].map((ahead) => minus(ahead, times(up, dot(ahead, up))));
  const ahead = unit(flat.find((along) => Math.hypot(...along) > 1e-3));
  return { right: cross(ahead, up), up, ahead };
}

/** Where an orbit's viewer is: `yaw_deg` to the right of behind the photo's camera, `pitch_deg` above the target. */
export function eyeOf({ target_m, yaw_deg, pitch_deg, distance_m }, { right, up, ahead }) {
  const [yaw, pitch] = [(yaw_deg * Math.PI) / 180, (pitch_deg * Math.PI) / 180];
  const flat = add(times(right, Math.sin(yaw)), times(ahead, -Math.cos(yaw)));
  return add(target_m, times(add(times(flat, Math.cos(pitch)), times(up, Math.sin(pitch))), distance_m));
}

/** The camera of a view, as `OutsideView` of the program says. */
export function cameraOf({ eye_m, target_m, fov_deg, width, height }, up) {
  const ahead = unit(minus(target_m, eye_m));
  const right = unit(cross(ahead, up));
  const focal = (0.5 * height) / Math.tan((fov_deg * Math.PI) / 360);
  return { eye_m, axes: [right, cross(right, ahead), times(ahead, -1)], fx: focal, fy: focal, cx: width / 2, cy: height / 2 };
}

/** A point in such a camera's frame. */
export const inFrame = ({ eye_m, axes }, point) => axes.map((axis) => dot(axis, minus(point, eye_m)));

/**
 * Builds the view. `page` as in `gestures.js`, with `exposure`; `picture` is the photo's, of which the frustum holds a small one; `probePlace()` is the probe's
 * place, or null. The answer: `toggle()`, `take(message, bytes)`, `again()` when what is to be seen changed, `reset()` for another scene, `draw()`.
 */
export function outsideView(page, picture, probePlace) {
  const stage = byId("stage");
  const canvas = byId("outside");
  const context = canvas.getContext("2d");
  const photoLabel = stage.getAttribute("aria-label");
  let orbit = null;
  let sequence = 0;
  const asked = new Map();
  let moving = null;
  let isWanted = false;
  let stillTimer = 0;
  let patience = 0;
  let thumbnail = null;

  const outside = {
    isOn: false,
    /** Sequence, view and size of the picture that is shown. */
    shown: null,
    orbit: () => orbit,
    /** Whether the picture is a still one of the view at hand. */
    isStill: () => Boolean(outside.shown?.view.still && outside.shown.sequence === sequence),
    toggle() { show(!outside.isOn); },
    again() {
      if (!outside.isOn || !page.scene) return;
      isWanted = true;
      askMoving();
      clearTimeout(stillTimer);
      stillTimer = setTimeout(askStill, STILL_MS);
    },
    reset() {
      [orbit, outside.shown, thumbnail, moving] = [null, null, null, null];
      outside.again();
    },
    async take({ sequence: number, mime, took_ms }, bytes) {
      const view = asked.get(number);
      for (const older of asked.keys()) if (older <= number) asked.delete(older);
      if (number === moving) {
        moving = null;
        clearTimeout(patience);
        if (isWanted) askMoving();
      }
      const bitmap = await createImageBitmap(new Blob([bytes], { type: mime }));
      if (!view || number < (outside.shown?.sequence ?? 0)) return bitmap.close();
      outside.shown?.bitmap.close();
      outside.shown = { sequence: number, view, bitmap, took_ms, developed: null };
      page.redraw();
      return undefined;
    },
    draw,
  };

  function show(isOn) {
    outside.isOn = isOn;
    canvas.hidden = byId("outside-note").hidden = !isOn;
    stage.dataset.view = isOn ? "room" : "photo";
    stage.setAttribute("aria-label", isOn ? STAGE_LABEL : photoLabel);
    byId("view-photo").setAttribute("aria-pressed", String(!isOn));
    byId("view-room").setAttribute("aria-pressed", String(isOn));
    outside.again();
    page.redraw();
  }
  byId("view-photo").onclick = () => show(false);
  byId("view-room").onclick = () => show(true);

  function ask(still) {
    const { up } = page.scene;
    orbit ??= started();
    const box = stage.getBoundingClientRect();
    const full = [box.width * devicePixelRatio, box.height * devicePixelRatio];
    const scale = still
      ? Math.min(1, STILL_SIZE[0] / full[0], STILL_SIZE[1] / full[1])
      : Math.min(1, MOVING_SIDE / Math.max(...full));
    const [width, height] = full.map((side) => Math.max(1, Math.floor(side * scale)));
    const what = byId("overlay").value;
    sequence += 1;
    const view = {
      eye_m: eyeOf(orbit, levelAxes(up)),
      target_m: orbit.target_m,
      fov_deg: FOV_DEG,
      width,
      height,
      exposure_ev: page.exposure,
      show: what === "" || what === "luminance" ? null : what,
      still,
    };
    asked.set(sequence, view);
    page.send({ type: "outside", sequence, view });
    return sequence;
  }
  /** The whole room. */
  function started() {
    const { middle_m, radius_m } = page.scene.extent;
    const distance_m = clamped(radius_m / Math.tan((FOV_DEG * Math.PI) / 360), ...DISTANCES_M);
    return { ...START, target_m: middle_m, distance_m };
  }

  // While the view moves one question at a time: the newest view waits for the answer to the last.
  function askMoving() {
    if (moving !== null) return;
    isWanted = false;
    moving = ask(false);
    clearTimeout(patience);
    patience = setTimeout(() => {
      moving = null;
      if (isWanted && outside.isOn && page.scene) askMoving();
    }, PATIENCE_MS);
  }
  function askStill() {
    if (!outside.isOn || !page.scene) return;
    // Never in the place of a picture that is still to come.
    if (moving !== null) stillTimer = setTimeout(askStill, STILL_MS);
    else ask(true);
    byId("outside-note").textContent = inWords();
  }

  function inWords() {
    const { yaw_deg, pitch_deg, distance_m } = orbit;
    const side = wrapped(yaw_deg);
    const degrees = (angle, positive, negative) => `${Math.round(Math.abs(angle))}° ${angle < 0 ? negative : positive}`;
    return `${degrees(side, "from the right", "from the left")}, ${degrees(pitch_deg, "from above", "from below")}, ${distance_m.toFixed(1)} m`;
  }

  const turn = (yaw, pitch) => {
    orbit.yaw_deg = wrapped(orbit.yaw_deg + yaw);
    orbit.pitch_deg = clamped(orbit.pitch_deg + pitch, -MAX_PITCH_DEG, MAX_PITCH_DEG);
    outside.again();
  };
  /** Moves the target by shares of the picture's height. */
  const pan = (right, up) => {
    const view = { eye_m: eyeOf(orbit, levelAxes(page.scene.up)), target_m: orbit.target_m, fov_deg: FOV_DEG, width: 1, height: 1 };
    const [x, y] = cameraOf(view, page.scene.up).axes;
    const height_m = 2 * orbit.distance_m * Math.tan((FOV_DEG * Math.PI) / 360);
    const moved = add(orbit.target_m, add(times(x, right * height_m), times(y, up * height_m)));
    orbit.target_m = moved.map((along) => clamped(along, -MAX_TARGET_M, MAX_TARGET_M));
    outside.again();
  };
  const zoom = (factor) => {
    orbit.distance_m = clamped(orbit.distance_m * factor, ...DISTANCES_M);
    outside.again();
  };
  const resetView = () => {
    orbit = started();
    outside.again();
  };
  const centre = () => {
    const object = page.selected();
    if (!object) return;
    orbit.target_m = middleOf(object);
    outside.again();
  };

  // The stage below knows of none of it: there the same movements are those of objects in the photo.
  let drag = null;
  const on = (kind, action) => canvas.addEventListener(kind, (event) => {
    event.stopPropagation();
    if (page.scene && orbit) action(event);
  });
  on("pointerdown", (event) => {
    event.preventDefault();
    stage.focus();
    canvas.setPointerCapture(event.pointerId);
    drag = { at: [event.clientX, event.clientY], isPan: event.button !== 0 || event.shiftKey, moved: 0 };
  });
  on("pointermove", (event) => {
    if (!drag) return;
    const [dx, dy] = [event.clientX - drag.at[0], event.clientY - drag.at[1]];
    drag.at = [event.clientX, event.clientY];
    drag.moved += Math.abs(dx) + Math.abs(dy);
    const { height } = canvas.getBoundingClientRect();
    if (drag.isPan) pan(-dx / height, dy / height);
    else turn((-200 * dx) / height, (200 * dy) / height);
  });
  const end = (event) => {
    if (drag && drag.moved < 4 && event.type === "pointerup" && !drag.isPan) page.select(objectAt(event)?.id ?? null);
    drag = null;
  };
  on("pointerup", end);
  on("pointercancel", end);
  on("contextmenu", (event) => event.preventDefault());
  on("dblclick", resetView);
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    if (page.scene && orbit) zoom(Math.exp(clamped(event.deltaY, -300, 300) / 700));
  }, { passive: false });

  const keys = {
    ArrowLeft: [() => turn(-5, 0), () => pan(-0.05, 0)],
    ArrowRight: [() => turn(5, 0), () => pan(0.05, 0)],
    ArrowUp: [() => turn(0, 5), () => pan(0, 0.05)],
    ArrowDown: [() => turn(0, -5), () => pan(0, -0.05)],
    Home: [resetView],
    "+": [() => zoom(1 / 1.1)],
    "=": [() => zoom(1 / 1.1)],
    "-": [() => zoom(1.1)],
    c: [centre],
  };
  // Before the photo's keys, some of which are the same.
  document.addEventListener("keydown", (event) => {
    if (!outside.isOn || !page.scene || !orbit || event.ctrlKey || event.metaKey || event.altKey) return;
    const key = keys[event.key] ?? keys[event.key.toLowerCase()];
    if (!key || event.target.closest?.("input, select, textarea, dialog[open], aside, header, footer")) return;
    event.preventDefault();
    event.stopPropagation();
    (event.shiftKey && key[1] ? key[1] : key[0])();
  }, true);

  function objectAt(event) {
    const { shown } = outside;
    if (!shown) return null;
    const box = canvas.getBoundingClientRect();
    const camera = cameraOf(shown.view, page.scene.up);
    const { width, height } = shown.view;
    const at = [((event.clientX - box.left) / box.width) * width, ((event.clientY - box.top) / box.height) * height];
    const distance = (object) => -inFrame(camera, middleOf(object))[2];
    const seen = (page.view?.objects ?? []).filter((object) => {
      const points = corners(object).map((corner) => project(camera, inFrame(camera, corner)));
      return !points.includes(null) && isInHull(points, at);
    });
    return seen.sort((a, b) => distance(a) - distance(b))[0] ?? null;
  }

  new ResizeObserver(() => {
    const { width, height } = stage.getBoundingClientRect();
    canvas.width = Math.max(1, Math.round(width * devicePixelRatio));
    canvas.height = Math.max(1, Math.round(height * devicePixelRatio));
    outside.again();
    page.redraw();
  }).observe(stage);

  function draw() {
    if (!outside.isOn) return;
    context.clearRect(0, 0, canvas.width, canvas.height);
    const { shown } = outside;
    if (!shown || !page.scene) return;
    context.imageSmoothingQuality = "high";
    context.drawImage(developed(shown), 0, 0, canvas.width, canvas.height);
    const pen = new Pen(context, shown.view, page.scene.up);
    const level = levelAxes(page.scene.up);
    drawGrid(pen, page.scene.extent, level);
    drawFrustum(pen, page.scene, small());
    drawPlumb(pen, page.scene.extent, level);
    for (const light of page.view?.lights ?? []) drawLight(pen, light, page.scene.extent);
    for (const object of page.view?.objects ?? []) drawObject(pen, object, object.id === page.selectedId);
    const place = probePlace();
    if (place) drawProbe(pen, place);
    drawAxes(pen, level);
  }

  /** The picture as it is to be seen; its exposure is the program's work. */
  function developed(shown) {
    if (byId("overlay").value !== "luminance") return shown.bitmap;
    if (!shown.developed) {
      const { width, height } = shown.bitmap;
      shown.developed = new OffscreenCanvas(width, height);
      const work = shown.developed.getContext("2d", { willReadFrequently: true });
      work.drawImage(shown.bitmap, 0, 0);
      const image = work.getImageData(0, 0, width, height);
      falseColour(image.data, 1);
      work.putImageData(image, 0, 0);
    }
    return shown.developed;
  }

  /** The photo with what stands in it, small. */
  function small() {
    if (!picture.bitmap) return null;
    if (thumbnail?.of !== picture.shown) {
      const { width, height } = page.scene.camera;
      const scale = 256 / Math.max(width, height);
      const work = new OffscreenCanvas(Math.max(1, Math.round(width * scale)), Math.max(1, Math.round(height * scale)));
      const into = work.getContext("2d");
      into.imageSmoothingQuality = "high";
      into.drawImage(picture.bitmap, 0, 0, work.width, work.height);
      thumbnail = { of: picture.shown, work };
    }
    return thumbnail.work;
  }

  return outside;
}

const clamped = (value, least, most) => Math.min(Math.max(value, least), most);
const wrapped = (angle) => angle - 360 * Math.round(angle / 360);
const middleOf = (object) => times(corners(object).reduce(add), 1 / 8);

/** Draws points of the room into a canvas that holds the picture of a view. */
class Pen {
  constructor(context, view, up) {
    const { canvas } = context;
    this.context = context;
    this.camera = cameraOf(view, up);
    this.scale = [canvas.width / view.width, canvas.height / view.height];
    this.rem = parseFloat(getComputedStyle(document.documentElement).fontSize) * devicePixelRatio;
  }

  /** Canvas position of a point; null behind the viewer. */
  at(point) {
    return this.seen(inFrame(this.camera, point));
  }

  seen(inView) {
    const pixel = project(this.camera, inView);
    return pixel && [pixel[0] * this.scale[0], pixel[1] * this.scale[1]];
  }

  /** Lines from point to point, as far as they lie before the viewer. `width` and `dash` in rem. */
  line(points, color, width, { dash = [], isPlain = false } = {}) {
    const { context, rem } = this;
    context.beginPath();
    const inView = points.map((point) => inFrame(this.camera, point));
    for (let i = 1; i < inView.length; i++) {
      const ends = clippedNear(inView[i - 1], inView[i]);
      if (!ends) continue;
      context.moveTo(...this.seen(ends[0]));
      context.lineTo(...this.seen(ends[1]));
    }
    context.setLineDash(dash.map((length) => length * rem));
    context.lineCap = "round";
    if (!isPlain) {
      // Dark below, so that it shows on everything.
      context.strokeStyle = "#0009";
      context.lineWidth = (width + 0.1) * rem;
      context.stroke();
    }
    context.strokeStyle = color;
    context.lineWidth = width * rem;
    context.stroke();
    context.setLineDash([]);
  }

  /** A text beside a point; `offset` in rem. */
  label(point, text, color, [right, down] = [0.5, -0.5]) {
    const at = this.at(point);
    if (at) this.text([at[0] + right * this.rem, at[1] + down * this.rem], text, color);
  }

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

  /** A line with a head at its end. */
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

  /** A circle in the room. */
  ring(centre, normal, radius, color, width, options) {
    const [x, y] = across(normal);
    const point = (i) => add(centre, add(times(x, radius * Math.cos((i * Math.PI) / 24)), times(y, radius * Math.sin((i * Math.PI) / 24))));
    this.line(Array.from({ length: 49 }, (_, i) => point(i)), color, width, options);
  }

  /** Unit vector from a point to the viewer. */
  towards(point) {
    return unit(minus(this.camera.eye_m, point));
  }
}

/** The part of a line that lies before the viewer, in the viewer's frame; null where none does. */
function clippedNear(a, b) {
  const [near, far] = a[2] > b[2] ? [a, b] : [b, a];
  if (far[2] > -NEAR_M) return null;
  if (near[2] <= -NEAR_M) return [a, b];
  const share = (-NEAR_M - far[2]) / (near[2] - far[2]);
  return [far, add(far, times(minus(near, far), share))];
}

/** Two unit vectors across a third one and each other. */
function across(normal) {
  const least = normal.map(Math.abs).indexOf(Math.min(...normal.map(Math.abs)));
  const x = unit(cross(normal, [0, 1, 2].map((axis) => Number(axis === least))));
  return [x, cross(normal, x)];
}

/** The floor in metres, counted from below the photo's camera. */
function drawGrid(pen, { middle_m, radius_m, floor_m }, { right, up, ahead }) {
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

/** What the photo sees, with the photo before its camera. */
function drawFrustum(pen, { camera, extent }, image) {
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

/** An image on a rectangle of the room, in so many parts that perspective does not show. */
function drawImageOn(pen, image, place) {
  const PARTS = 8;
  const { context } = pen;
  const corner = Array.from({ length: PARTS + 1 }, (_, j) => Array.from({ length: PARTS + 1 }, (__, i) => pen.at(place(i / PARTS, j / PARTS))));
  if (corner.flat().includes(null)) return;
  const [width, height] = [image.width / PARTS, image.height / PARTS];
  context.save();
  for (let j = 0; j < PARTS; j++) {
    for (let i = 0; i < PARTS; i++) {
      const [[x, y], [rightX, rightY], [belowX, belowY]] = [corner[j][i], corner[j][i + 1], corner[j + 1][i]];
      context.setTransform((rightX - x) / width, (rightY - y) / width, (belowX - x) / height, (belowY - y) / height, x, y);
      // A pixel more, so that no gaps show.
      const [more, below] = [i + 1 < PARTS ? 1 : 0, j + 1 < PARTS ? 1 : 0];
      context.drawImage(image, i * width, j * height, width + more, height + below, 0, 0, width + more, height + below);
    }
  }
  context.restore();
}

/** From the camera down to the floor, and how high that is. */
function drawPlumb(pen, { floor_m }, { up }) {
  if (floor_m >= 0) return;
  const foot = times(up, floor_m);
  pen.line([[0, 0, 0], foot], "#f0a93b", 0.1, { dash: [0.3, 0.3] });
  pen.dot(foot, 0.14, "#f0a93b");
  pen.label(times(foot, 0.5), `${(-floor_m).toFixed(2)} m`, "#f0a93b", [0.5, 0]);
}

function drawObject(pen, object, isSelected) {
  const box = corners(object);
  const color = isSelected ? "#f0a93b" : "#ffffff";
  for (const [a, b] of EDGES) pen.line([box[a], box[b]], color, 0.11);
  pen.label(times([4, 5, 6, 7].map((i) => box[i]).reduce(add), 1 / 4), object.name, color, [-0.5, -0.9]);
}

/** A light: a ring of its area that faces where it shines to, a sphere, or the arrow of a sun; dashed where it is off. */
function drawLight(pen, light, extent) {
  const isOn = light.changed?.on ?? true;
  const own = light.changed?.color?.rgb ?? light.radiance;
  const color = isOn ? hexFromLinear(own.map((value) => value / Math.max(...own, 1e-6))) : "#9a9a9a";
  const options = { dash: isOn ? [] : [0.25, 0.25] };
  if (light.kind === "sun") {
    const from = add(extent.middle_m, times(light.direction, 1.1 * extent.radius_m));
    pen.arrow(from, add(extent.middle_m, times(light.direction, 0.6 * extent.radius_m)), color, 0.16, options);
    pen.dot(from, 0.45, color);
    pen.label(from, light.id, color, [0.8, 0]);
    return;
  }
  const at = light.changed?.at_m ?? light.position_m;
  if (!at) return;
  const radius = light.radius_m ?? Math.sqrt(Math.max(light.area_m2 ?? 0, 0) / Math.PI);
  pen.ring(at, light.direction ?? pen.towards(at), radius, color, 0.09, options);
  if (light.direction) pen.arrow(at, add(at, times(light.direction, Math.max(0.3, 0.8 * radius))), color, 0.09, options);
  pen.dot(at, 0.2, color);
  pen.label(at, light.id, color);
}

function drawProbe(pen, place) {
  pen.ring(place, pen.towards(place), 0.1, "#56b4e9", 0.1);
  pen.dot(place, 0.14, "#56b4e9");
  pen.label(place, "probe", "#56b4e9", [0.5, 1]);
}

/** Which way is up, right and ahead for the photo's camera, in the corner. */
function drawAxes(pen, { right, up, ahead }) {
  const { context, rem } = pen;
  const centre = [context.canvas.width - 4.6 * rem, 4.6 * rem];
  context.beginPath();
  context.arc(...centre, 3.9 * rem, 0, 2 * Math.PI);
  context.fillStyle = "#1b1b1bb0";
  context.fill();
  const named = [["right", right, "#e0705f"], ["up", up, "#8fce6a"], ["ahead", ahead, "#7aa7ea"]]
    .map(([name, axis, color]) => ({ name, color, inView: pen.camera.axes.map((own) => dot(own, axis)) }));
  // The farthest first.
  for (const { name, color, inView: [x, y] } of named.sort((a, b) => a.inView[2] - b.inView[2])) {
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
