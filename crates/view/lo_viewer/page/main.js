// The page: hears the program, shows what it says, and wires the parts.

import { byId, element, say } from "./dom.js";
import { listen } from "./gestures.js";
import { drawHandles, drawWhite } from "./handles.js";
import { lightsPanel } from "./lights.js";
import { objectsPanel } from "./objects.js";
import { outsideView } from "./outside.js";
import { LUMINANCE_LEGEND, Picture } from "./picture.js";
import { probePanel } from "./probe.js";
import { connect } from "./server.js";
import { timelinePanel } from "./timeline.js";
import { listenForFiles, save } from "./uploads.js";

const STEPS = { moving: "draft", resting: "normal quality", final: "high quality: as insert writes it" };

/** How many pictures the figures of a movement are of. */
const MEASURED = 200;
/** The panels are brought up to date this often at most, milliseconds. */
const PANELS_MS = 100;

const page = {
  scene: null,
  view: null,
  change: 0,
  materials: [],
  selectedId: null,
  hovered: null,
  picking: null,
  exposure: 0,
  selected: () => page.view?.objects.find((object) => object.id === page.selectedId) ?? null,
  isOpen: () => page.scene !== null,
  /** Whether what stands in the photo may be lost. */
  mayLeave: () => !page.view?.objects.length || confirm("What stands in this photo is lost. Open another one?"),
};
// For tests and the curious: what was measured while something moved.
const figures = { latencies_ms: [], frames_at_ms: [], sent: new Map(), shown: null };
globalThis.viewer = { page, figures };

const stage = byId("stage");
const handles = byId("handles");
const picture = new Picture(byId("picture"), shownFrame);
let sequence = 0;
let waiting = null;
let panelsTimer = null;
let panelsAt = -PANELS_MS;

const tellServer = connect(hear, () => setAt("connecting"));
/** Shows what a command comes to; at most once for each picture of the screen. */
page.preview = (command) => {
  const isFirst = waiting === null;
  waiting = { command, at: performance.now() };
  if (isFirst) requestAnimationFrame(sendPreview);
};
function sendPreview() {
  if (!waiting) return;
  sequence += 1;
  figures.sent.set(sequence, waiting.at);
  tellServer({ type: "preview", command: waiting.command, sequence });
  waiting = null;
}
page.seek = (time_s) => {
  sequence += 1;
  figures.sent.set(sequence, performance.now());
  tellServer({ type: "seek", time_s, sequence });
};
page.send = (message) => {
  // What waits to be previewed belongs before what keeps it, and goes with what drops it.
  if (message.type === "commit" || message.type === "command") sendPreview();
  if (message.type === "cancel") waiting = null;
  const isSaid = tellServer(message);
  if (!isSaid && message.type !== "probe" && message.type !== "outside") say("there is no connection to the program", true);
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
  const { width, height } = page.scene.camera;
  return [((event.clientX - box.left) / box.width) * width, ((event.clientY - box.top) / box.height) * height];
};
const rem = () => parseFloat(getComputedStyle(document.documentElement).fontSize);
page.reach = () => (rem() * page.scene.camera.width) / handles.getBoundingClientRect().width;
page.hover = (pixel) => {
  const { width, height } = page.scene.camera;
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
    const gesture = page.gesture?.();
    const active = gesture?.handle ?? null;
    const scale = handles.width / page.scene.camera.width;
    const hovered = gesture ? null : page.view?.objects.find((object) => object.id === page.hovered?.id);
    const context = handles.getContext("2d");
    drawHandles(context, scale, rem() * ratio, page.scene.camera, page.selected(), hovered, active);
    const { white, light, effect } = page.view?.guessed_light ?? {};
    if (white && light !== "even" && effect === "expected") drawWhite(context, scale, rem() * ratio, white);
    outside.draw();
  });
};

page.keys = {
  n: () => {
    const ids = (page.view?.objects ?? []).map((object) => object.id);
    if (ids.length) page.select(ids[(ids.indexOf(page.selectedId) + 1) % ids.length]);
  },
  p: () => probe.hold(),
  v: () => outside.toggle(),
  f: () => setOverlay(byId("overlay").value === "luminance" ? "" : "luminance"),
  0: () => setExposure(0),
  "?": () => byId("help").showModal(),
};

listenForFiles(page);
const probe = probePanel(page);
const showObjects = objectsPanel(page);
const showLights = lightsPanel(page);
const timeline = timelinePanel(page);
listen(stage, page);
const outside = outsideView(page, picture, () => probe.shown_m);
viewer.outside = outside;

function hear(message, pictures) {
  switch (message.type) {
    case "hello":
      page.materials = message.materials;
      break;
    case "empty":
      page.scene = page.view = null;
      byId("open-error").textContent = message.error ?? "";
      byId("open-text").hidden = !message.can_estimate;
      setAt("empty");
      break;
    case "opening":
      page.scene = page.view = null;
      byId("opening-file").textContent = `Opening ${message.file}`;
      byId("opening-stage").textContent = message.stage || "reading";
      if (message.done === null) byId("opening-progress").removeAttribute("value");
      else byId("opening-progress").value = message.done;
      setAt("opening");
      break;
    case "scene":
      openScene(message);
      break;
    case "state":
      showState(message);
      break;
    case "notes":
      if (message.change === page.change) message.notes.forEach((note) => say(note));
      break;
    case "progress":
      if (message.change === page.change) {
        byId("progress").hidden = false;
        byId("progress").value = message.done;
        setStatus(`${STEPS[message.step].split(":")[0]}: ${message.stage}`);
      }
      break;
    case "photo":
      picture.takePhoto(pictures[0]);
      break;
    case "frame":
      picture.take(message, pictures[0]);
      break;
    case "probe":
    case "no-probe":
      probe.take(message, pictures);
      break;
    case "overlay":
      takeOverlay(message, pictures[0]);
      break;
    case "outside":
      outside.take(message, pictures[0]);
      break;
    case "film":
      timeline.film(message);
      break;
    case "refused":
      say(message.why, true);
      break;
    default:
  }
}

function setAt(at) {
  document.body.dataset.at = at;
  byId("open").hidden = at !== "empty";
  byId("opening").hidden = at !== "opening";
  if (at === "connecting") setStatus("no connection to the program; trying again …");
}

function openScene(scene) {
  const isNew = page.scene?.scene !== scene.scene;
  page.scene = scene;
  byId("file").textContent = scene.is_saved ? scene.file : `${scene.file} (not saved)`;
  setAt("scene");
  if (isNew) {
    page.selectedId = null;
    page.picking?.(null);
    picture.forget();
    probe.shown_m = null;
    outside.reset();
    setOverlay("");
    scene.notes.forEach((note) => say(note));
  }
  layOut();
}

function showState({ change, view }) {
  if (!page.scene) return;
  const known = new Set(page.view?.objects.map((object) => object.id) ?? view.objects.map((object) => object.id));
  // Whoever adds something wants to move it next.
  const added = view.objects.find((object) => !known.has(object.id));
  page.view = view;
  page.change = change;
  if (added) page.selectedId = added.id;
  if (!page.selected()) page.selectedId = null;
  page.redraw();
  outside.again();
  // What moves needs the processor more than its numbers do.
  panelsTimer ??= setTimeout(showPanels, panelsAt + PANELS_MS - performance.now());
}

function showPanels() {
  panelsTimer = null;
  panelsAt = performance.now();
  const { scene, view } = page;
  if (!view) return;
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

/** A frame is shown. */
function shownFrame(frame) {
  const now = performance.now();
  if (frame.step === "moving" && figures.sent.has(frame.sequence)) {
    figures.latencies_ms.push(now - figures.sent.get(frame.sequence));
    figures.frames_at_ms.push(now);
    for (const list of [figures.latencies_ms, figures.frames_at_ms]) if (list.length > MEASURED) list.shift();
    for (const sent of figures.sent.keys()) if (sent <= frame.sequence) figures.sent.delete(sent);
  }
  figures.shown = frame;
  if (outside.isOn) page.redraw();
  timeline.arrived();
  if (frame.change !== page.change) return;
  const isLast = frame.step === "final";
  byId("progress").hidden = isLast || !page.view?.objects.length;
  if (!isLast) byId("progress").removeAttribute("value");
  if (!page.view?.objects.length) setStatus("the photo");
  else if (frame.step !== "moving") setStatus(`${STEPS[frame.step]}, ${(frame.took_ms / 1000).toFixed(1)} s`);
  else setStatus(movement(now));
}

/** Pictures a second and latency of the movement at hand. */
function movement(now) {
  const recent = figures.frames_at_ms.filter((at) => now - at < 1000).length;
  const last = figures.latencies_ms[figures.latencies_ms.length - 1];
  return recent > 1 ? `draft, ${recent} pictures/s, ${Math.round(last)} ms` : "draft";
}

function setStatus(text) {
  if (byId("status").textContent !== text) byId("status").textContent = text;
}

function layOut() {
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
  picture.draw();
  page.redraw();
}
new ResizeObserver(layOut).observe(stage);

function showLegend(lines) {
  const legend = byId("legend");
  legend.hidden = !lines.length;
  legend.replaceChildren(...lines.map(([color, text]) => {
    const patch = element("i");
    patch.style.background = color;
    return element("span", {}, patch, text);
  }));
}

function setOverlay(what) {
  byId("overlay").value = what;
  picture.isFalseColour = what === "luminance";
  picture.lay(null);
  showLegend(what === "luminance" ? LUMINANCE_LEGEND : []);
  if (what && what !== "luminance") page.send({ type: "overlay", what });
  outside.again();
}

async function takeOverlay(message, bytes) {
  const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
  if (byId("overlay").value !== message.what) return bitmap.close();
  showLegend(message.legend);
  return picture.lay(bitmap);
}

function setExposure(stops) {
  page.exposure = picture.exposure = stops;
  byId("exposure").value = stops;
  byId("exposure-value").textContent = `${stops > 0 ? "+" : ""}${Math.round(10 * stops) / 10} EV`;
  picture.draw();
  probe.again();
  outside.again();
}

byId("overlay").onchange = (event) => setOverlay(event.target.value);
byId("exposure").oninput = (event) => setExposure(event.target.valueAsNumber);
byId("exposure").ondblclick = () => setExposure(0);
byId("undo").onclick = () => page.send({ type: "undo" });
byId("redo").onclick = () => page.send({ type: "redo" });
byId("close").onclick = () => page.mayLeave() && page.send({ type: "close" });
byId("opening-stop").onclick = () => page.send({ type: "stop" });
byId("help-button").onclick = () => byId("help").showModal();
byId("copy").onclick = async () => {
  await navigator.clipboard.writeText(byId("command").textContent);
  const { scene, view } = page;
  const isUnsaved = !scene.is_saved || view.edited;
  say(isUnsaved ? `copied; save the scene as ${scene.file} before (Save, Scene)` : "copied");
};
for (const button of document.querySelectorAll("#save button")) {
  button.onclick = () => {
    byId("save").open = false;
    if (button.dataset.file === "light.exr" && !probe.place) {
      say("point at the photo first: the light of which place?", true);
      return;
    }
    if ("film" in button.dataset) {
      if (!page.view?.timeline.span_s) say("nothing moves yet: select an object and add keyframes (K)", true);
      // The browser's own download: it goes to the disk as it is made.
      else element("a", { href: `download/${button.dataset.file}`, download: button.dataset.file }).click();
      return;
    }
    const needsPicture = ["picture.png", "layers.exr"].includes(button.dataset.file);
    if (needsPicture && page.view?.objects.length) say("as soon as the picture of high quality is finished …");
    save(button.dataset.file, "probe" in button.dataset && probe.place ? probe.query() : "");
  };
}
document.addEventListener("click", (event) => {
  if (!event.target.closest("#save")) byId("save").open = false;
});
