// The light at the pointer: panorama, mirror ball, and who says what the panorama shows.

import { byId, element, short } from "./dom.js";

/** Builds the panel. The answer: `at(pixel)` asks for a place, `take(message, pictures)` shows it, `place` is the last one, `hold()` holds it or lets it go. */
export function probePanel(page) {
  const panorama = element("canvas", { className: "panorama", role: "img", "aria-label": "Panorama of the light at the pointer" });
  const ball = element("canvas", { className: "ball", role: "img", "aria-label": "Mirror ball at the pointer" });
  const note = element("p", { className: "note", textContent: "Point at the photo." });
  const lift = element("input", { type: "number", value: 0.1, step: 0.05, min: 0, max: 5, id: "probe-lift" });
  const held = element("input", { type: "checkbox", id: "probe-held" });
  const origins = element("input", { type: "checkbox", id: "probe-origins" });
  byId("probe").append(
    element("div", { className: "pictures" }, panorama, ball),
    element("div", { className: "row spread" }, note,
      element("label", { className: "inline", textContent: "above, m ", htmlFor: "probe-lift" }), lift),
    element("div", { className: "row spread" },
      element("label", { className: "inline", title: "P" }, held, "hold here (P)"),
      element("label", { className: "inline", title: "blue: the photo, green: a panorama, orange: guessed" }, origins, "seen or guessed")));
  byId("probe").style.display = "grid";
  byId("probe").style.gap = "0.5rem";

  let bitmaps = null;
  let isAsked = false;
  let next = null;
  let patience = 0;
  const draw = () => {
    if (!bitmaps) return;
    const show = (canvas, bitmap) => {
      [canvas.width, canvas.height] = [bitmap.width, bitmap.height];
      canvas.getContext("2d").drawImage(bitmap, 0, 0);
    };
    show(panorama, bitmaps[origins.checked ? 2 : 0]);
    show(ball, bitmaps[1]);
  };
  origins.onchange = draw;

  const probe = {
    place: null,
    /** Where the light that is shown is, metres. */
    shown_m: null,
    ask(pixel) {
      probe.place = pixel;
      // One question at a time: the newest place waits for the answer to the last.
      if (isAsked) {
        next = pixel;
        return;
      }
      isAsked = true;
      clearTimeout(patience);
      patience = setTimeout(() => answered(), 3000);
      page.send({ type: "probe", pixel, lift_m: lift.valueAsNumber || 0, exposure_ev: page.exposure });
    },
    at(pixel) {
      if (!held.checked) probe.ask(pixel);
    },
    again() {
      if (probe.place) probe.ask(probe.place);
    },
    hold() {
      held.checked = !held.checked;
    },
    query() {
      const [u, v] = probe.place;
      return `?u=${u}&v=${v}&lift=${lift.valueAsNumber || 0}`;
    },
    async take(message, pictures) {
      answered();
      if (message.type === "no-probe") {
        note.textContent = "No depth is known there.";
        probe.shown_m = null;
        return;
      }
      bitmaps = await Promise.all(pictures.map((bytes) => createImageBitmap(new Blob([bytes], { type: "image/png" }))));
      note.textContent = `at ${message.at_m.map(short).join(", ")} m`;
      probe.shown_m = message.at_m;
      draw();
    },
  };
  const answered = () => {
    isAsked = false;
    if (next) {
      const pixel = next;
      next = null;
      probe.ask(pixel);
    }
  };
  lift.onchange = () => probe.again();
  return probe;
}
