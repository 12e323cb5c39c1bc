// The light at the pointer: panorama, mirror ball, and provenance.

import { byId, contextOf, element, short } from "./dom.js";

/** @import { Pixel, Vector } from "./camera.js" */
/** @import { ToPage } from "./protocol.d.ts" */
/** @import { Page } from "./store.js" */

/**
 * Builds the panel. Returns `at(pixel)` to request the light above a photo position, `again()` to repeat the request,
 * `take(message, images)` for responses, `pixel` and `shown_m` (last requested photo position and shown point),
 * `hold()` to toggle holding, and `query()` for downloads.
 *
 * @param {Pick<Page, "send" | "exposure">} page
 */
export function probePanel(page) {
  const panorama = element("canvas", { className: "panorama", role: "img", "aria-label": "Panorama of the light at the pointer" });
  const ball = element("canvas", { className: "ball", role: "img", "aria-label": "Mirror ball at the pointer" });
  const note = element("p", { className: "note", textContent: "Point at the photo." });
  const lift = element("input", { type: "number", value: 0.1, step: 0.05, min: 0, max: 5, id: "probe-lift" });
  const held = element("input", { type: "checkbox", id: "probe-held" });
  const provenance = element("input", { type: "checkbox", id: "probe-provenance" });
  byId("probe").append(
    element("div", { className: "pictures" }, panorama, ball),
    element("div", { className: "row spread" }, note,
      element("label", { className: "inline", textContent: "lift, m ", htmlFor: "probe-lift" }), lift),
    element("div", { className: "row spread" },
      element("label", { className: "inline", title: "P" }, held, "hold here (P)"),
      element("label", { className: "inline", title: "blue: photo, green: panorama, orange: inferred" }, provenance, "provenance")));
  byId("probe").style.display = "grid";
  byId("probe").style.gap = "0.5rem";

  /** @type {ImageBitmap[] | null} */
  let bitmaps = null;
  let isPending = false;
  /** @type {Pixel | null} */
  let next = null;
  let timeout = 0;
  const draw = () => {
    if (!bitmaps) return;
    /** @type {(canvas: HTMLCanvasElement, bitmap: ImageBitmap) => void} */
    const show = (canvas, bitmap) => {
      [canvas.width, canvas.height] = [bitmap.width, bitmap.height];
      contextOf(canvas).drawImage(bitmap, 0, 0);
    };
    show(panorama, bitmaps[provenance.checked ? 2 : 0]);
    show(ball, bitmaps[1]);
  };
  provenance.onchange = draw;

  const probe = {
    /** Last requested photo position. */
    pixel: /** @type {Pixel | null} */ (null),
    /** The shown point, metres. */
    shown_m: /** @type {Vector | null} */ (null),
    /** @param {Pixel} pixel */
    request(pixel) {
      probe.pixel = pixel;
      // One request at a time: the newest position waits for the response to the last.
      if (isPending) {
        next = pixel;
        return;
      }
      isPending = true;
      clearTimeout(timeout);
      timeout = setTimeout(() => finished(), 3000);
      page.send({ type: "probe", pixel, lift_m: lift.valueAsNumber || 0, exposure_ev: page.exposure });
    },
    /** @param {Pixel} pixel */
    at(pixel) {
      if (!held.checked) probe.request(pixel);
    },
    again() {
      if (probe.pixel) probe.request(probe.pixel);
    },
    hold() {
      held.checked = !held.checked;
    },
    query() {
      if (!probe.pixel) return "";
      const [u, v] = probe.pixel;
      return `?u=${u}&v=${v}&lift=${lift.valueAsNumber || 0}`;
    },
    /**
     * @param {Extract<ToPage, { type: "probe" | "no-probe" }>} message
     * @param {BlobPart[]} images
     */
    async take(message, images) {
      finished();
      if (message.type === "no-probe") {
        note.textContent = "The photo has no depth there.";
        probe.shown_m = null;
        return;
      }
      bitmaps = await Promise.all(images.map((bytes) => createImageBitmap(new Blob([bytes], { type: "image/png" }))));
      note.textContent = `at ${message.at_m.map(short).join(", ")} m`;
      probe.shown_m = message.at_m;
      draw();
    },
  };
  const finished = () => {
    isPending = false;
    if (next) {
      const pixel = next;
      next = null;
      probe.request(pixel);
    }
  };
  lift.onchange = () => probe.again();
  return probe;
}
