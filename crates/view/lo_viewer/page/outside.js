// The room from outside: the program's images, overlay lines, and the orbit camera.

import { add, complete, corners, isInHull, project, times } from "./camera.js";
import { byId, contextOf } from "./dom.js";
import { falseColour } from "./image_view.js";
import { FOV_DEG, cameraOf, eyeOf, inFrame, inWords, levelAxes, orbitAround, pan, rotate, zoom } from "./orbit.js";
import { outsideImages } from "./outside_images.js";
import { listenOutside } from "./outside_input.js";
import { roomLightAt, roomLightDrag } from "./outside_lights.js";
import { drawLines } from "./outside_lines.js";

/** @import { Vector } from "./camera.js" */
/** @import { ImageView } from "./image_view.js" */
/** @import { Orbit } from "./orbit.js" */
/** @import { OutsideImage } from "./outside_images.js" */
/** @import { ObjectView, OutsideView, Overlay } from "./protocol.d.ts" */
/** @import { Frame, Page } from "./store.js" */

/**
 * Overlays that the program renders.
 *
 * @type {Overlay[]}
 */
export const OVERLAYS = ["depth", "normals", "levels", "origins"];

/** Longer side of images during a movement, and maximum size at rest; pixels. */
const MOVING_SIDE = 640;
const STILL_SIZE = [1920, 1440];

/** Longer side of the photo in the frustum, pixels. */
const THUMBNAIL_SIDE = 256;

const STAGE_LABEL = "The room from outside. Arrow keys rotate the view, with Shift they pan; plus and minus zoom, Home resets; question mark lists all keys.";

/**
 * Builds the view. `photo` is the photo's `ImageView`, shown small in the frustum; `probePosition()` returns the
 * probe's position or null.
 *
 * Returns `toggle()`, `take(message, bytes)`, `again()` to request the current view, `reset()` for another scene,
 * `draw()`, and for tests `isOn`, `shown`, `orbit()` and `isStill()`.
 *
 * @param {Page} page
 * @param {ImageView} photo
 * @param {() => Vector | null} probePosition
 */
export function outsideView(page, photo, probePosition) {
  const stage = byId("stage");
  const canvas = byId("outside");
  const context = contextOf(canvas);
  const photoLabel = stage.getAttribute("aria-label") ?? "";
  /** @type {Orbit | null} */
  let orbit = null;
  /** @type {{ of: Frame | null, work: OffscreenCanvas } | null} */
  let thumbnail = null;

  const images = outsideImages(page, {
    isOn: () => outside.isOn && page.isOpen(),
    viewOf,
    arrived: () => page.redraw(),
    rested: () => { byId("outside-note").textContent = inWords(currentOrbit()); },
  });

  const outside = {
    isOn: false,
    get shown() { return images.shown; },
    orbit: () => orbit,
    isStill: images.isStill,
    toggle() { show(!outside.isOn); },
    again: images.again,
    take: images.take,
    reset() {
      [orbit, thumbnail] = [null, null];
      images.reset();
      images.again();
    },
    draw,
  };

  /** Returns the orbit; at first one that shows the whole room. */
  function currentOrbit() {
    orbit ??= orbitAround(page.openScene().extent);
    return orbit;
  }

  /** @param {boolean} isOn */
  function show(isOn) {
    outside.isOn = isOn;
    canvas.hidden = byId("outside-note").hidden = !isOn;
    stage.dataset.view = isOn ? "room" : "photo";
    stage.setAttribute("aria-label", isOn ? STAGE_LABEL : photoLabel);
    byId("view-photo").setAttribute("aria-pressed", String(!isOn));
    byId("view-room").setAttribute("aria-pressed", String(isOn));
    page.hint("");
    images.again();
    page.redraw();
  }
  byId("view-photo").onclick = () => show(false);
  byId("view-room").onclick = () => show(true);

  /**
   * Returns the view to request.
   *
   * @param {boolean} still
   * @returns {OutsideView}
   */
  function viewOf(still) {
    const { up } = page.openScene();
    const { target_m } = currentOrbit();
    const box = stage.getBoundingClientRect();
    const full = [box.width * devicePixelRatio, box.height * devicePixelRatio];
    const scale = still
      ? Math.min(1, STILL_SIZE[0] / full[0], STILL_SIZE[1] / full[1])
      : Math.min(1, MOVING_SIDE / Math.max(...full));
    const [width, height] = full.map((side) => Math.max(1, Math.floor(side * scale)));
    const overlay = byId("overlay").value;
    return {
      eye_m: eyeOf(currentOrbit(), levelAxes(up)),
      target_m,
      fov_deg: FOV_DEG,
      width,
      height,
      exposure_ev: page.exposure,
      show: OVERLAYS.find((each) => each === overlay) ?? null,
      still,
    };
  }

  listenOutside(stage, canvas, () => page.isOpen() && orbit !== null, {
    rotate(yaw, pitch) {
      rotate(currentOrbit(), yaw, pitch);
      images.again();
    },
    pan(right, up) {
      pan(currentOrbit(), page.openScene().up, right, up);
      images.again();
    },
    zoom(factor) {
      zoom(currentOrbit(), factor);
      images.again();
    },
    resetView() {
      orbit = orbitAround(page.openScene().extent);
      images.again();
    },
    centre() {
      const object = page.selected();
      if (!object) return;
      currentOrbit().target_m = middleOf(object);
      images.again();
    },
    click: (event) => page.select(objectAt(event)?.id ?? null, event.shiftKey),
    grab,
  });

  /**
   * Returns camera, position and reach of a pointer event in the shown view; null without an image.
   *
   * @param {MouseEvent} event
   */
  function pointed(event) {
    const { shown } = images;
    if (!shown) return null;
    const box = canvas.getBoundingClientRect();
    const { width, height } = shown.view;
    /** @type {[number, number]} */
    const at = [((event.clientX - box.left) / box.width) * width, ((event.clientY - box.top) / box.height) * height];
    const reach = (parseFloat(getComputedStyle(document.documentElement).fontSize) * width) / box.width;
    return { camera: cameraOf(shown.view, page.openScene().up), at, reach };
  }

  /**
   * Starts to drag the light at the pointer.
   *
   * @param {PointerEvent} event
   */
  function grab(event) {
    const start = pointed(event);
    const { extent, up } = page.openScene();
    const light = start && roomLightAt(start.camera, page.view?.lights ?? [], extent, start.at, 0.8 * start.reach);
    if (!light) return null;
    page.selectLight(light.id);
    const command = roomLightDrag(start.camera, up, extent, light, start.at);
    let isMoved = false;
    return {
      /** @param {PointerEvent} moved */
      move(moved) {
        const now = pointed(moved);
        const made = now && command(now.at, moved.shiftKey);
        if (!made) return;
        isMoved = true;
        page.preview(made);
      },
      /** @param {boolean} isKept */
      end(isKept) {
        if (isMoved) page.send({ type: isKept ? "commit" : "cancel" });
      },
    };
  }

  canvas.addEventListener("pointermove", (event) => {
    const hovered = event.buttons || !page.scene ? null : pointed(event);
    const light = hovered && roomLightAt(hovered.camera, page.view?.lights ?? [], page.openScene().extent, hovered.at, 0.8 * hovered.reach);
    const how = light?.kind === "sun" ? "drag to turn it around the room" : "drag to move it at its height, with Shift up and down";
    if (!event.buttons) page.hint(light ? `${light.id}: ${how}.` : "");
  });

  /** @param {MouseEvent} event */
  function objectAt(event) {
    const where = pointed(event);
    if (!where) return null;
    const { camera, at } = where;
    /** @param {ObjectView} object */
    const distance = (object) => -inFrame(camera, middleOf(object))[2];
    const hit = (page.view?.objects ?? []).filter((object) => {
      const points = complete(corners(object).map((corner) => project(camera, inFrame(camera, corner))));
      return points && isInHull(points, at);
    });
    return hit.sort((a, b) => distance(a) - distance(b))[0] ?? null;
  }

  new ResizeObserver(() => {
    const { width, height } = stage.getBoundingClientRect();
    canvas.width = Math.max(1, Math.round(width * devicePixelRatio));
    canvas.height = Math.max(1, Math.round(height * devicePixelRatio));
    images.again();
    page.redraw();
  }).observe(stage);

  function draw() {
    if (!outside.isOn) return;
    context.clearRect(0, 0, canvas.width, canvas.height);
    const { shown } = images;
    if (!shown || !page.scene) return;
    context.imageSmoothingQuality = "high";
    context.drawImage(developed(shown), 0, 0, canvas.width, canvas.height);
    drawLines(context, shown.view, page, photoThumbnail(), probePosition());
  }

  /**
   * Returns the image for display. The program applies exposure already.
   *
   * @param {OutsideImage} shown
   */
  function developed(shown) {
    if (byId("overlay").value !== "luminance") return shown.bitmap;
    if (!shown.developed) {
      const { width, height } = shown.bitmap;
      shown.developed = new OffscreenCanvas(width, height);
      const work = contextOf(shown.developed, { willReadFrequently: true });
      work.drawImage(shown.bitmap, 0, 0);
      const image = work.getImageData(0, 0, width, height);
      falseColour(image.data, 1);
      work.putImageData(image, 0, 0);
    }
    return shown.developed;
  }

  /** Returns a small copy of the photo with its objects, or null. */
  function photoThumbnail() {
    if (!photo.bitmap) return null;
    if (thumbnail?.of !== photo.shown) {
      const { width, height } = page.openScene().camera;
      const scale = THUMBNAIL_SIDE / Math.max(width, height);
      const work = new OffscreenCanvas(Math.max(1, Math.round(width * scale)), Math.max(1, Math.round(height * scale)));
      const into = contextOf(work);
      into.imageSmoothingQuality = "high";
      into.drawImage(photo.bitmap, 0, 0, work.width, work.height);
      thumbnail = { of: photo.shown, work };
    }
    return thumbnail.work;
  }

  return outside;
}

/** @param {ObjectView} object */
const middleOf = (object) => times(corners(object).reduce(add), 1 / 8);
