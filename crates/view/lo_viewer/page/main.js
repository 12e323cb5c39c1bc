// The page: receives the program's messages, updates the page, and connects its parts.

import { around, byId, contextOf, copyText, element, showMessage } from "./dom.js";
import { listen } from "./gestures.js";
import { drawBox, drawDropLine, drawHandles, drawWhite, gizmoOf } from "./handles.js";
import { ImageView, LUMINANCE_LEGEND } from "./image_view.js";
import { drawLights, lightsOnPhoto } from "./light_marks.js";
import { lightsPanel } from "./lights.js";
import { measurePanel } from "./measure.js";
import { objectsPanel, sizeNote } from "./objects.js";
import { levelAxes } from "./orbit.js";
import { OVERLAYS, outsideView } from "./outside.js";
import { rememberPanels } from "./panels.js";
import { photoStage } from "./photo_stage.js";
import { probePanel } from "./probe.js";
import { saving } from "./saving.js";
import { existing, selecting } from "./selection.js";
import { connect } from "./server.js";
import { startPage } from "./start.js";
import { figures, page } from "./store.js";
import { timelinePanel } from "./timeline.js";
import { listenForFiles, save } from "./uploads.js";

/** @import { Command, SceneInfo, ToPage } from "./protocol.d.ts" */
/** @import { Frame } from "./store.js" */

/** @typedef {Extract<ToPage, { type: "overlay" }>} OverlayMessage */

const STEPS = { moving: "draft", resting: "normal quality", final: "high quality: identical to the output of insert" };

/** Number of drafts that the measurements of a movement cover. */
const MEASURED = 200;
/** Minimum interval between updates of the panels, milliseconds. */
const PANELS_MS = 100;

const stage = byId("stage");
const handles = byId("handles");
const imageView = new ImageView(byId("picture"), onFrameShown);
let sequence = 0;
/** @type {{ command: Command, at: number } | null} */
let pendingPreview = null;
/** @type {number | null} */
let panelsTimer = null;
let panelsAt = -PANELS_MS;

const sendToServer = connect(receive, (why) => {
  setScreen("connecting");
  setStatus(why ? `${why}; waiting until one is closed …` : "not connected to the program; reconnecting …");
});
page.preview = (command) => {
  const isFirst = pendingPreview === null;
  pendingPreview = { command, at: performance.now() };
  if (isFirst) requestAnimationFrame(sendPreview);
};
function sendPreview() {
  if (!pendingPreview) return;
  sequence += 1;
  figures.sent.set(sequence, pendingPreview.at);
  sendToServer({ type: "preview", command: pendingPreview.command, sequence });
  pendingPreview = null;
}
page.seek = (time_s) => {
  sequence += 1;
  figures.sent.set(sequence, performance.now());
  sendToServer({ type: "seek", time_s, sequence });
};
page.send = (message) => {
  // A pending preview is sent before the message that commits it, and dropped by a cancel.
  if (message.type === "commit" || message.type === "command") sendPreview();
  if (message.type === "cancel") pendingPreview = null;
  const isSent = sendToServer(message);
  if (!isSent && message.type !== "probe" && message.type !== "outside") showMessage("not connected to the program", true);
};

selecting(page, () => {
  if (page.view) {
    showObjects();
    showLights();
    timeline.show();
  }
  page.redraw();
});
page.photoLights = () => lightsOnPhoto(page);
page.hint = (text) => {
  byId("stage-hint").hidden = !text;
  byId("stage-hint").textContent = text;
};

const photo = photoStage(page, stage, imageView);
const rem = () => parseFloat(getComputedStyle(document.documentElement).fontSize);
page.visible = () => {
  const { origin: [left, top], scale, width, height } = photo.shown();
  return { left, top, right: left + width / scale, bottom: top + height / scale };
};
/** @param {import("./protocol.d.ts").ObjectView | null} object */
const gizmo = (object) => object && gizmoOf(page.openScene().camera, object, levelAxes(page.openScene().up), page.visible(), page.reach());
page.gizmo = () => {
  const object = page.selected();
  return object && !object.is_locked && !object.is_hidden ? gizmo(object) : null;
};
page.hover = (pixel) => {
  const { width, height } = page.openScene().camera;
  if (pixel[0] >= 0 && pixel[1] >= 0 && pixel[0] < width && pixel[1] < height) probe.at(pixel);
};
let isDrawing = false;
page.redraw = () => {
  if (isDrawing) return;
  isDrawing = true;
  requestAnimationFrame(() => {
    isDrawing = false;
    if (!page.scene) return;
    const ratio = devicePixelRatio;
    const gesture = page.gesture();
    const active = gesture?.handle ?? null;
    const { scale: shownScale, origin } = photo.shown();
    const scale = shownScale * ratio;
    const selected = page.selected();
    const hovered = gesture ? null : page.view?.objects.find(({ id }) => id === page.hovered?.id && id !== selected?.id) ?? null;
    const context = contextOf(handles);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, handles.width, handles.height);
    context.translate(-origin[0] * scale, -origin[1] * scale);
    if (selected && !selected.rests && !selected.is_hidden) {
      const { camera, up, extent } = page.scene;
      drawDropLine(context, scale, rem() * ratio, camera, selected.position_m, up, extent.floor_m);
    }
    for (const other of page.group()) {
      const box = other.id === selected?.id ? null : gizmo(other)?.box;
      if (box) drawBox(context, scale, rem() * ratio, box, "#f0a93b");
    }
    drawHandles(context, scale, rem() * ratio, page.gizmo(), gizmo(hovered), active);
    drawLights(context, scale, rem() * ratio, page.photoLights(), page.selectedLight, gesture?.object === null ? active : null);
    const { white, light, effect } = page.view?.inferred_light ?? {};
    measure.draw(context, scale, rem() * ratio);
    if (white && light !== "even" && effect === "expected") drawWhite(context, scale, rem() * ratio, white);
    outside.draw();
  });
};

Object.assign(page.keys, {
  n: () => {
    const ids = (page.view?.objects ?? []).map((object) => object.id);
    if (ids.length) page.select(ids[(ids.findIndex((id) => id === page.selectedId) + 1) % ids.length]);
  },
  p: () => probe.hold(),
  v: () => outside.toggle(),
  f: () => setOverlay(byId("overlay").value === "luminance" ? "" : "luminance"),
  0: () => setExposure(0),
  b: () => photo.toggleWipe(),
  Home: () => page.zoom(0),
  "?": () => byId("help").showModal(),
});

listenForFiles(page);
saving(page);
const start = startPage(page);
rememberPanels();
const probe = probePanel(page);
const showObjects = objectsPanel(page);
const showLights = lightsPanel(page);
const measure = measurePanel(page);
const timeline = timelinePanel(page);
listen(stage, page);
const outside = outsideView(page, imageView, () => probe.shown_m);
// For tests.
Object.assign(globalThis, { viewer: { page, figures, outside } });

/**
 * Receives a message of the program.
 *
 * @param {ToPage} message
 * @param {Uint8Array<ArrayBuffer>[]} images
 */
function receive(message, images) {
  switch (message.type) {
    case "hello":
      page.materials = message.materials;
      page.autosaves = message.autosaves;
      start.setSamples(message.samples, message.can_estimate);
      break;
    case "recent":
      start.setRecent(message.rooms);
      break;
    case "empty":
      page.scene = page.view = null;
      setScreen("empty");
      start.show(true, message.error ?? "");
      break;
    case "opening-ended":
      byId("opening").hidden = true;
      break;
    case "opening":
      byId("opening").hidden = false;
      byId("opening-note").hidden = !page.isOpen();
      byId("opening-file").textContent = `Opening ${message.file}`;
      byId("opening-stage").textContent = message.stage || "reading";
      if (message.done === null) byId("opening-progress").removeAttribute("value");
      else byId("opening-progress").value = message.done;
      break;
    case "scene":
      openScene(message);
      break;
    case "state":
      showState(message);
      break;
    case "notes":
      if (message.change === page.change) message.notes.forEach((note) => showMessage(note));
      break;
    case "progress":
      if (message.change === page.change) {
        byId("progress").hidden = false;
        byId("progress").value = message.done;
        setStatus(`${STEPS[message.step].split(":")[0]}: ${message.stage}`);
      }
      break;
    case "photo":
      imageView.setPhoto(images[0]);
      break;
    case "frame":
      imageView.take(message, images[0]);
      break;
    case "probe":
    case "no-probe":
      probe.take(message, images);
      break;
    case "measured":
      measure.take(message);
      break;
    case "overlay":
      takeOverlay(message, images[0]);
      break;
    case "outside":
      outside.take(message, images[0]);
      break;
    case "film":
      timeline.showDownload(message);
      break;
    case "refused":
      showMessage(message.why, true);
      break;
    default:
  }
}

/** @param {"connecting" | "empty" | "scene"} at */
function setScreen(at) {
  document.body.dataset.at = at;
}

/** @param {SceneInfo} scene */
function openScene(scene) {
  const isNew = page.scene?.scene !== scene.scene;
  const isScaled = page.scene?.extent.radius_m !== scene.extent.radius_m;
  page.scene = scene;
  setScreen("scene");
  if (isNew) {
    start.show(false);
    // Until its state arrives.
    page.view = null;
    page.select(null);
    page.picking?.(null);
    measure.reset();
    imageView.reset();
    photo.reset();
    probe.shown_m = null;
    outside.reset();
    setOverlay("");
    scene.notes.forEach((note) => showMessage(note));
  } else if (isScaled) outside.reset();
  photo.resize();
}

/** @param {Extract<ToPage, { type: "state" }>} message */
function showState({ change, view }) {
  if (!page.scene) return;
  const known = page.view ?? view;
  // What was added is selected, to be moved next.
  const added = view.objects.filter(({ id }) => !known.objects.some((object) => object.id === id));
  const light = view.lights.find(({ id, origin }) => origin === "added" && !known.lights.some((other) => other.id === id));
  const note = added.length === 1 && !added[0].path && view.can_undo ? sizeNote(added[0]) : "";
  if (note) showMessage(note);
  page.view = view;
  page.change = change;
  Object.assign(page, existing(page, view.objects));
  if (!view.lights.some(({ id }) => id === page.selectedLight)) page.selectedLight = null;
  added.forEach(({ id }, i) => page.select(id, i > 0));
  // A sun is aimed by an object's shadow.
  const shaded = page.selected() ?? view.objects.filter(({ is_hidden }) => !is_hidden).at(-1);
  if (light?.kind === "sun" && shaded) page.select(shaded.id);
  else if (light) page.selectLight(light.id);
  page.redraw();
  outside.again();
  // During a movement, drafts are more important than the panels.
  panelsTimer ??= setTimeout(showPanels, panelsAt + PANELS_MS - performance.now());
}

function showPanels() {
  panelsTimer = null;
  panelsAt = performance.now();
  const { scene, view } = page;
  if (!scene || !view) return;
  byId("undo").disabled = !view.can_undo;
  byId("redo").disabled = !view.can_redo;
  const isUnsaved = !view.has_file || view.edited;
  byId("file").textContent = view.file + (view.unsaved || !view.has_file ? " – not saved" : "");
  byId("file").title = view.file;
  byId("command").textContent = view.command ?? "";
  byId("command").title = view.command && isUnsaved ? `save the scene as ${view.file} first (Ctrl+S)` : "";
  byId("copy").hidden = !view.command;
  showObjects();
  showLights();
  measure.show();
  timeline.show();
}

/**
 * Records latencies and updates the status when a frame is shown.
 *
 * @param {Frame} frame
 */
function onFrameShown(frame) {
  const now = performance.now();
  const sent_ms = figures.sent.get(frame.sequence);
  if (frame.step === "moving" && sent_ms !== undefined) {
    figures.latencies_ms.push(now - sent_ms);
    figures.frames_at_ms.push(now);
    for (const list of [figures.latencies_ms, figures.frames_at_ms]) if (list.length > MEASURED) list.shift();
  }
  for (const sent of figures.sent.keys()) if (sent <= frame.sequence) figures.sent.delete(sent);
  figures.shown = frame;
  if (outside.isOn) page.redraw();
  timeline.frameShown();
  if (frame.change !== page.change) return;
  const isLast = frame.step === "final";
  byId("progress").hidden = isLast || !page.view?.objects.length;
  if (!isLast) byId("progress").removeAttribute("value");
  if (!page.view?.objects.length) setStatus("the photo");
  else if (frame.step !== "moving") setStatus(`${STEPS[frame.step]}, ${(frame.took_ms / 1000).toFixed(1)} s`);
  else setStatus(movement(now));
}

/**
 * Describes the rate and latency of the current movement.
 *
 * @param {number} now
 */
function movement(now) {
  const recent = figures.frames_at_ms.filter((at) => now - at < 1000).length;
  const last = figures.latencies_ms[figures.latencies_ms.length - 1];
  return recent > 1 ? `draft, ${recent} images/s, ${Math.round(last)} ms` : "draft";
}

/** @param {string} text */
function setStatus(text) {
  if (byId("status").textContent !== text) byId("status").textContent = text;
}

/**
 * Shows colours and their meanings.
 *
 * @param {[string, string][]} lines
 */
function showLegend(lines) {
  const legend = byId("legend");
  legend.hidden = !lines.length;
  legend.replaceChildren(...lines.map(([color, text]) => {
    const patch = element("i");
    patch.style.background = color;
    return element("span", {}, patch, text);
  }));
}

/**
 * Sets the overlay; "" for none, "luminance" for false colour.
 *
 * @param {string} what
 */
function setOverlay(what) {
  byId("overlay").value = what;
  imageView.isFalseColour = what === "luminance";
  imageView.setOverlay(null);
  showLegend(what === "luminance" ? LUMINANCE_LEGEND : []);
  const requested = OVERLAYS.find((each) => each === what);
  if (requested) page.send({ type: "overlay", what: requested });
  outside.again();
}

/** @type {(message: OverlayMessage, bytes: BlobPart) => Promise<void>} */
async function takeOverlay(message, bytes) {
  const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
  if (byId("overlay").value !== message.what) return bitmap.close();
  showLegend(message.legend);
  return imageView.setOverlay(bitmap);
}

/** @param {number} stops */
function setExposure(stops) {
  page.exposure = imageView.exposure = stops;
  byId("exposure").value = String(stops);
  byId("exposure-value").textContent = `${stops > 0 ? "+" : ""}${Math.round(10 * stops) / 10} EV`;
  imageView.draw();
  probe.again();
  outside.again();
}

byId("overlay").onchange = () => setOverlay(byId("overlay").value);
byId("exposure").oninput = () => setExposure(byId("exposure").valueAsNumber);
byId("exposure").ondblclick = () => setExposure(0);
byId("undo").onclick = () => page.send({ type: "undo" });
byId("redo").onclick = () => page.send({ type: "redo" });
byId("opening-stop").onclick = () => page.send({ type: "stop" });
byId("help-button").onclick = () => byId("help").showModal();
byId("copy").onclick = async () => {
  if (!await copyText(byId("command"))) {
    showMessage("the browser does not allow copying; the command is selected: press Ctrl-C or ⌘C");
    return;
  }
  const view = page.openView();
  const isUnsaved = !view.has_file || view.edited;
  showMessage(isUnsaved ? `copied; save the scene as ${view.file} before you run it (Ctrl+S)` : "copied");
};
for (const button of byId("export").querySelectorAll("button")) {
  if (button.id === "save-as") continue;
  const { file = "" } = button.dataset;
  button.onclick = () => {
    byId("export").open = false;
    if (file === "light.exr" && !probe.pixel) {
      showMessage("point at the photo first, to place the probe", true);
      return;
    }
    if ("sequence" in button.dataset) {
      if (!page.view?.timeline.span_s) showMessage("nothing is animated yet: select an object and add keyframes (K)", true);
      // A browser download, which is written to the disk as it is rendered.
      else element("a", { href: `download/${file}`, download: file }).click();
      return;
    }
    const needsImage = ["picture.png", "layers.exr"].includes(file);
    if (needsImage && page.view?.objects.length) showMessage("the download starts when the high-quality image is finished …");
    save(file, "probe" in button.dataset && probe.pixel ? probe.query() : "");
  };
}
document.addEventListener("click", (event) => {
  if (!around(event, "#export") || around(event, "#save-as")) byId("export").open = false;
});
