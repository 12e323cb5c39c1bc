// The photo on the stage: its canvases, zoom and pan, and the wipe between photo and result.

import { byId, showMessage } from "./dom.js";
import { PhotoView } from "./photo_view.js";

/** @import { ImageView } from "./image_view.js" */
/** @import { Page } from "./store.js" */

/** Zoom factor of a key or button. */
const STEP = 1.25;

/**
 * Lays out the photo's canvases. Provides `page.photoPosition`, `page.reach`, `page.startPan` and `page.zoom`. Returns
 * `resize()`, `reset()` for another scene, `toggleWipe()`, and `shown()`, the part of the photo on the stage.
 *
 * @param {Page} page
 * @param {HTMLElement} stage
 * @param {ImageView} imageView
 */
export function photoStage(page, stage, imageView) {
  const view = new PhotoView();
  const canvases = [byId("picture"), byId("handles")];
  const rem = () => parseFloat(getComputedStyle(document.documentElement).fontSize);
  /** @type {(event: MouseEvent) => [number, number]} */
  const onStage = (event) => {
    const box = stage.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const isActive = () => page.isOpen() && stage.dataset.view !== "room";

  const layout = () => {
    const { camera } = page.openScene();
    view.resize(camera, stage.getBoundingClientRect());
    const { scale, left, top, width, height, origin } = view.shown();
    for (const canvas of canvases) {
      Object.assign(canvas.style, { left: `${left}px`, top: `${top}px`, width: `${width}px`, height: `${height}px` });
      canvas.width = Math.round(width * devicePixelRatio);
      canvas.height = Math.round(height * devicePixelRatio);
    }
    imageView.region = {
      x: origin[0] / camera.width,
      y: origin[1] / camera.height,
      width: width / scale / camera.width,
      height: height / scale / camera.height,
    };
    imageView.isMagnified = scale * devicePixelRatio > 3;
    byId("zoom-fit").textContent = view.zoom === 1 ? "Fit" : `${Math.round(100 * scale * devicePixelRatio)} %`;
    byId("zoom-out").disabled = view.zoom === 1;
    stage.dataset.zoomed = String(view.zoom > 1);
    placeWipe();
    imageView.draw();
    page.redraw();
  };
  /** @type {(factor: number, at: [number, number]) => void} */
  const zoomAt = (factor, at) => {
    view.zoomAt(factor, at);
    layout();
  };
  page.photoPosition = (event) => view.photoPosition(onStage(event));
  page.reach = () => rem() / view.shown().scale;
  page.zoom = (direction) => {
    if (!page.isOpen()) return;
    const { width, height } = view.stage;
    if (direction === 0) view.reset();
    else view.zoomAt(STEP ** direction, [width / 2, height / 2]);
    layout();
  };
  byId("zoom-in").onclick = () => page.zoom(1);
  byId("zoom-out").onclick = () => page.zoom(-1);
  byId("zoom-fit").onclick = () => page.zoom(0);

  stage.addEventListener("wheel", (event) => {
    if (!isActive()) return;
    event.preventDefault();
    zoomAt(Math.exp(Math.min(Math.max(-event.deltaY, -300), 300) / 400), onStage(event));
  }, { passive: false });

  // Panning with the middle or right button, or by dragging what is no object.
  /** @type {[number, number] | null} */
  let last = null;
  page.startPan = (event) => {
    if (!isActive() || view.zoom === 1) return;
    last = [event.clientX, event.clientY];
    stage.setPointerCapture(event.pointerId);
    stage.dataset.panning = "true";
  };
  stage.addEventListener("pointerdown", (event) => {
    if (event.button === 1 || event.button === 2) {
      event.preventDefault();
      page.startPan(event);
    }
  });
  stage.addEventListener("pointermove", (event) => {
    if (!last) return;
    view.pan(event.clientX - last[0], event.clientY - last[1]);
    last = [event.clientX, event.clientY];
    layout();
  });
  const end = () => {
    last = null;
    delete stage.dataset.panning;
  };
  for (const kind of /** @type {const} */ (["pointerup", "pointercancel", "lostpointercapture"])) stage.addEventListener(kind, end);
  stage.addEventListener("contextmenu", (event) => event.preventDefault());

  // The wipe: the photo as taken on the left, the result on the right.
  const wipe = byId("wipe");
  /** Position as a photo column; null without a wipe. */
  let wipeAt = /** @type {number | null} */ (null);
  const placeWipe = () => {
    imageView.wipe = null;
    if (wipeAt === null) return;
    const { scale, left, width, origin } = view.shown();
    const at = Math.min(Math.max((wipeAt - origin[0]) * scale, 0), width);
    imageView.wipe = at / width;
    wipe.style.left = `${left + at}px`;
    wipe.setAttribute("aria-valuenow", String(Math.round((100 * wipeAt) / page.openScene().camera.width)));
  };
  /** @param {number | null} column */
  const setWipe = (column) => {
    wipeAt = column;
    wipe.hidden = column === null;
    byId("compare").setAttribute("aria-pressed", String(column !== null));
    if (page.scene) layout();
  };
  /** @param {number} column */
  const moveWipe = (column) => setWipe(Math.min(Math.max(column, 0), page.openScene().camera.width));
  wipe.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    event.stopPropagation();
    wipe.focus();
    wipe.setPointerCapture(event.pointerId);
  });
  wipe.addEventListener("pointermove", (event) => {
    event.stopPropagation();
    if (wipe.hasPointerCapture(event.pointerId)) moveWipe(page.photoPosition(event)[0]);
  });
  wipe.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -0.02, ArrowRight: 0.02, Home: -1, End: 1 }[event.key];
    if (step === undefined || wipeAt === null) return;
    event.preventDefault();
    event.stopPropagation();
    moveWipe(wipeAt + step * page.openScene().camera.width);
  });
  const toggleWipe = async () => {
    if (wipeAt !== null || !page.isOpen()) return setWipe(null);
    if (stage.dataset.view === "room") byId("view-photo").click();
    const { scene, camera } = page.openScene();
    setWipe(camera.width / 2);
    try {
      const answer = await fetch("download/photo.jpg");
      if (!answer.ok) throw new Error(await answer.text());
      const original = await createImageBitmap(await answer.blob());
      if (page.scene?.scene === scene) imageView.original = original;
    } catch {
      showMessage("the photo could not be loaded: is the program still running?", true);
    }
    return layout();
  };
  byId("compare").onclick = toggleWipe;

  new ResizeObserver(() => { if (page.isOpen()) layout(); }).observe(stage);
  return {
    resize: layout,
    reset() {
      view.reset();
      setWipe(null);
    },
    toggleWipe,
    shown: () => view.shown(),
  };
}
