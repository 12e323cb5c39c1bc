// The page: receives the program's messages, updates the page, and connects its parts.

import { around, byId, contextOf, copyText, element, showMessage } from "./dom.js";
import { listen } from "./gestures.js";
import { drawHandles, drawWhite } from "./handles.js";
import { ImageView, LUMINANCE_LEGEND } from "./image_view.js";
import { lightsPanel } from "./lights.js";
import { objectsPanel } from "./objects.js";
import { OVERLAYS, outsideView } from "./outside.js";
import { probePanel } from "./probe.js";
import { connect } from "./server.js";
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

page.select = (id) => {
  if (page.selectedId === id) return;
  page.selectedId = id;
  if (page.view) {
    showObjects();
    timeline.show();
  }
  page.redraw();
};

page.photoPosition = (event) => {
  const box = handles.getBoundingClientRect();
  const { width, height } = page.openScene().camera;
  return [((event.clientX - box.left) / box.width) * width, ((event.clientY - box.top) / box.height) * height];
};
const rem = () => parseFloat(getComputedStyle(document.documentElement).fontSize);
page.reach = () => (rem() * page.openScene().camera.width) / handles.getBoundingClientRect().width;
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
    const scale = handles.width / page.scene.camera.width;
    const hovered = gesture ? null : page.view?.objects.find((object) => object.id === page.hovered?.id) ?? null;
    const context = contextOf(handles);
    drawHandles(context, scale, rem() * ratio, page.scene.camera, page.selected(), hovered, active);
    const { white, light, effect } = page.view?.inferred_light ?? {};
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
  "?": () => byId("help").showModal(),
});

listenForFiles(page);
const probe = probePanel(page);
const showObjects = objectsPanel(page);
const showLights = lightsPanel(page);
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
      break;
    case "empty":
      page.scene = page.view = null;
      byId("open-error").textContent = message.error ?? "";
      byId("open-text").hidden = !message.can_estimate;
      setScreen("empty");
      break;
    case "opening":
      page.scene = page.view = null;
      byId("opening-file").textContent = `Opening ${message.file}`;
      byId("opening-stage").textContent = message.stage || "reading";
      if (message.done === null) byId("opening-progress").removeAttribute("value");
      else byId("opening-progress").value = message.done;
      setScreen("opening");
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

/** @param {"connecting" | "empty" | "opening" | "scene"} at */
function setScreen(at) {
  document.body.dataset.at = at;
  byId("open").hidden = at !== "empty";
  byId("opening").hidden = at !== "opening";
}

/** @param {SceneInfo} scene */
function openScene(scene) {
  const isNew = page.scene?.scene !== scene.scene;
  page.scene = scene;
  byId("file").textContent = scene.is_saved ? scene.file : `${scene.file} (not saved)`;
  setScreen("scene");
  if (isNew) {
    page.selectedId = null;
    page.picking?.(null);
    imageView.reset();
    probe.shown_m = null;
    outside.reset();
    setOverlay("");
    scene.notes.forEach((note) => showMessage(note));
  }
  resizeCanvases();
}

/** @param {Extract<ToPage, { type: "state" }>} message */
function showState({ change, view }) {
  if (!page.scene) return;
  const known = new Set(page.view?.objects.map((object) => object.id) ?? view.objects.map((object) => object.id));
  // An added object is selected, to be moved next.
  const added = view.objects.find((object) => !known.has(object.id));
  page.view = view;
  page.change = change;
  if (added) page.selectedId = added.id;
  if (!page.selected()) page.selectedId = null;
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
  const isUnsaved = !scene.is_saved || view.edited;
  byId("command").textContent = view.command ?? "";
  byId("command").title = view.command && isUnsaved ? `save the scene as ${scene.file} first (Save, Scene)` : "";
  byId("copy").hidden = !view.command;
  showObjects();
  showLights();
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

function resizeCanvases() {
  if (!page.scene) return;
  const { width, height } = page.scene.camera;
  const box = stage.getBoundingClientRect();
  const scale = Math.min(box.width / width, box.height / height);
  for (const canvas of [byId("picture"), handles]) {
    const [shownWidth, shownHeight] = [width * scale, height * scale];
    canvas.style.width = `${shownWidth}px`;
    canvas.style.height = `${shownHeight}px`;
    canvas.style.left = `${(box.width - shownWidth) / 2}px`;
    canvas.style.top = `${(box.height - shownHeight) / 2}px`;
    canvas.width = Math.round(shownWidth * devicePixelRatio);
    canvas.height = Math.round(shownHeight * devicePixelRatio);
  }
  imageView.draw();
  page.redraw();
}
new ResizeObserver(resizeCanvases).observe(stage);

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
byId("close").onclick = () => page.mayLeave() && page.send({ type: "close" });
byId("opening-stop").onclick = () => page.send({ type: "stop" });
byId("help-button").onclick = () => byId("help").showModal();
byId("copy").onclick = async () => {
  if (!await copyText(byId("command"))) {
    showMessage("the browser does not allow copying; the command is selected: press Ctrl-C or ⌘C");
    return;
  }
  const [scene, view] = [page.openScene(), page.openView()];
  const isUnsaved = !scene.is_saved || view.edited;
  showMessage(isUnsaved ? `copied; save the scene as ${scene.file} before you run it (Save, Scene)` : "copied");
};
for (const button of byId("save").querySelectorAll("button")) {
  const { file = "" } = button.dataset;
  button.onclick = () => {
    byId("save").open = false;
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
  if (!around(event, "#save")) byId("save").open = false;
});
