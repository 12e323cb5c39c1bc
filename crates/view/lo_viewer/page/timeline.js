// The timeline: the playhead, and the keyframes of each animated object.

import { around, byId, element, fill, short, showMessage } from "./dom.js";

/** @import { Command, Interpolation, Path, ToPage } from "./protocol.d.ts" */
/** @import { Page } from "./store.js" */

/** @type {Interpolation[]} */
const INTERPOLATIONS = ["linear", "catmull-rom"];

/** Minimum displayed length, seconds. */
const LEAST_S = 5;

/** During playback, a frame that takes longer is skipped, milliseconds. */
const TIMEOUT_MS = 600;

/**
 * Builds the timeline. Returns `show()` to update it, `frameShown()`, and `showDownload(message)` for the progress of a
 * sequence download.
 *
 * @param {Page} page
 */
export function timelinePanel(page) {
  const strip = byId("timeline");
  const rows = byId("timeline-rows");
  const playhead = byId("playhead");
  /** @param {Command} command */
  const act = (command) => page.send({ type: "command", command });
  const timeline = () => page.openView().timeline;
  let isWanted = false;
  /** @type {{ begun: number, from: number, timer: number } | null} */
  let playing = null;
  /** @type {{ object: number, from: number, x: number, hasMoved: boolean } | null} */
  let drag = null;
  let length = LEAST_S;

  /** @param {number} time */
  const onFrame = (time) => nearestFrame(time, timeline().fps);
  /** @param {number} time */
  const seconds = (time) => `${time.toFixed(2)} s`;

  /** @param {boolean} isOpen */
  const open = (isOpen) => {
    isWanted = isOpen;
    if (page.view) show();
  };
  const addKey = () => {
    const object = page.selected();
    if (!object) return showMessage("select an object first, to add its keyframe", true);
    isWanted = true;
    return act({ do: "set-key", object: object.id, time_s: timeline().time_s });
  };

  const stop = () => {
    if (!playing) return;
    clearTimeout(playing.timer);
    playing = null;
    byId("play").textContent = "Play";
    // Stop on a frame.
    page.seek(onFrame(timeline().time_s));
  };
  /** Requests the frame at the clock's current time; earlier ones are skipped. */
  const next = () => {
    const { span_s: span, frames, fps } = timeline();
    if (!playing || !span) return stop();
    const share = playedShare(playing.from, (performance.now() - playing.begun) / 1000, frames, fps);
    clearTimeout(playing.timer);
    playing.timer = setTimeout(next, TIMEOUT_MS);
    page.seek(span[0] + share * (span[1] - span[0]));
    return undefined;
  };
  const play = () => {
    if (playing) return stop();
    const { span_s: span, time_s: time } = timeline();
    if (!span || span[0] === span[1]) return showMessage("nothing is animated yet: add two keyframes (K) at different times", true);
    const from = time > span[0] && time < span[1] ? (time - span[0]) / (span[1] - span[0]) : 0;
    playing = { begun: performance.now(), from, timer: 0 };
    byId("play").textContent = "Stop";
    return next();
  };

  Object.assign(page.keys, { k: addKey, " ": play });
  byId("timeline-button").onclick = () => open(Boolean(strip.hidden));
  byId("play").onclick = play;
  byId("add-key").onclick = addKey;
  byId("stop-sequence").onclick = () => page.send({ type: "stop-film" });
  byId("stage").addEventListener("pointerdown", stop);
  playhead.oninput = () => {
    if (playing) stop();
    page.seek(onFrame(playhead.valueAsNumber));
  };
  const sendFrames = () => {
    /** @param {HTMLInputElement} field */
    const count = (field) => (field.value === "" ? null : Math.round(field.valueAsNumber));
    const fps = count(byId("fps"));
    if (fps) act({ do: "frames", frames: count(byId("frames")), fps });
  };
  byId("frames").onchange = byId("fps").onchange = sendFrames;
  byId("interpolation").onchange = () => {
    const object = page.selected();
    const interpolation = INTERPOLATIONS.find((each) => each === byId("interpolation").value);
    if (object?.path && interpolation) act({ do: "interpolate", object: object.id, interpolation });
  };

  /** @param {MouseEvent} event */
  const timeAt = (event) => {
    const { left, width } = (rows.querySelector(".track") ?? rows).getBoundingClientRect();
    return onFrame(Math.min(Math.max((event.clientX - left) / width, 0), 1) * length);
  };
  rows.addEventListener("pointerdown", (event) => {
    const key = around(event, ".key");
    if (!key || event.button !== 0) return;
    stop();
    drag = { object: Number(key.dataset.object), from: Number(key.dataset.time), x: event.clientX, hasMoved: false };
    rows.setPointerCapture(event.pointerId);
    key.focus();
    event.preventDefault();
  });
  rows.addEventListener("pointermove", (event) => {
    if (!drag || (!drag.hasMoved && Math.abs(event.clientX - drag.x) < 4)) return;
    drag.hasMoved = true;
    page.preview({ do: "move-key", object: drag.object, from_s: drag.from, to_s: timeAt(event) });
  });
  /** @type {(object: number, time: number) => void} */
  const choose = (object, time) => {
    page.select(object);
    page.seek(time);
  };
  /** @param {boolean} isKept */
  const end = (isKept) => {
    if (!drag) return;
    const { object, from, hasMoved } = drag;
    drag = null;
    if (hasMoved) page.send({ type: isKept ? "commit" : "cancel" });
    else if (isKept) choose(object, from);
  };
  rows.addEventListener("pointerup", () => end(true));
  rows.addEventListener("pointercancel", () => end(false));
  // From Enter, Space or a screen reader.
  rows.addEventListener("click", (event) => {
    const key = around(event, ".key");
    if (key && event.detail === 0) choose(Number(key.dataset.object), Number(key.dataset.time));
  });
  strip.addEventListener("keydown", (event) => {
    const key = around(event, ".key");
    const name = event.key;
    if (name === "Escape" && drag) end(false);
    else if (key) {
      const [object, time] = [Number(key.dataset.object), Number(key.dataset.time)];
      const step = Number(name === "ArrowRight") - Number(name === "ArrowLeft");
      if (name === "Delete" || name === "Backspace") act({ do: "delete-key", object, time_s: time });
      else if (step) act({ do: "move-key", object, from_s: time, to_s: onFrame(time + step / timeline().fps) });
      else return;
    } else return;
    event.preventDefault();
    event.stopPropagation();
  });

  /** @type {(object: { id: number, name: string, path: Path }) => void} */
  const showRow = ({ id, name, path: { keyframes: keys } }) => {
    let row = rows.querySelector(`[data-row="${id}"]`);
    if (!row) {
      row = element("div", { className: "row-of-keys", "data-row": String(id) },
        element("span", { className: "name" }), element("div", { className: "track" }));
      rows.append(row);
    }
    const [label, track] = row.children;
    label.textContent = name;
    row.classList.toggle("selected", id === page.selectedId);
    while (track.children.length > keys.length) track.lastElementChild?.remove();
    while (track.children.length < keys.length) track.append(element("button", { className: "key", type: "button" }));
    keys.forEach((key, i) => {
      const button = track.children[i];
      if (!(button instanceof HTMLElement)) return;
      button.style.left = `${(100 * key.time_s) / length}%`;
      button.dataset.object = String(id);
      button.dataset.time = String(key.time_s);
      button.setAttribute("aria-label", `Keyframe of ${name} at ${short(key.time_s)} s`);
      button.title = `${short(key.time_s)} s; drag to move, Delete to remove`;
      button.classList.toggle("now", Math.abs(key.time_s - timeline().time_s) < 1e-4);
    });
  };

  const showRuler = () => {
    const ruler = byId("ruler");
    const step = rulerStep(length);
    const marks = [];
    for (let at = 0; at <= length + 1e-6; at += step) {
      const mark = element("span", { textContent: `${short(at)} s` });
      mark.style.left = `${(100 * at) / length}%`;
      marks.push(mark);
    }
    ruler.replaceChildren(...marks);
  };

  function show() {
    const { time_s: time, span_s: span, frames, is_chosen: isChosen, fps } = timeline();
    strip.hidden = !(isWanted || span);
    byId("timeline-button").setAttribute("aria-expanded", String(!strip.hidden));
    if (strip.hidden) return;
    // The scale is fixed while a keyframe is dragged.
    const needed = neededLength(span, time);
    const isNew = !drag && needed !== length;
    if (isNew) length = needed;
    if (isNew || !byId("ruler").childElementCount) showRuler();
    playhead.max = String(length);
    playhead.step = String(1 / fps);
    playhead.value = String(time);
    playhead.setAttribute("aria-valuetext", seconds(time));
    byId("time").textContent = seconds(time);
    byId("playhead-line").style.left = `${(100 * time) / length}%`;
    const moving = page.openView().objects.flatMap(({ id, name, path }) => (path ? [{ id, name, path }] : []));
    const ids = new Set(moving.map(({ id }) => String(id)));
    for (const row of rows.querySelectorAll("[data-row]")) if (!ids.has(row.getAttribute("data-row") ?? "")) row.remove();
    moving.forEach(showRow);
    byId("timeline-empty").hidden = moving.length > 0;
    byId("add-key").disabled = !page.selected();
    byId("play").disabled = !span || span[0] === span[1];
    fill(byId("frames"), isChosen ? frames : "");
    byId("frames").placeholder = String(frames);
    fill(byId("fps"), fps);
    byId("interpolation").disabled = !page.selected()?.path;
    fill(byId("interpolation"), page.selected()?.path?.interpolation ?? "linear");
  }

  return {
    show,
    frameShown() {
      if (playing) requestAnimationFrame(next);
    },
    /** @param {Extract<ToPage, { type: "film" }>} message */
    showDownload({ done, frames, left_s: left, ended }) {
      const isOver = ended !== null || done === frames;
      byId("sequence").hidden = isOver;
      if (ended && ended !== "stopped") showMessage(ended, true);
      else if (ended) showMessage("stopped; the downloaded file is incomplete");
      byId("sequence-progress").value = done / frames;
      byId("sequence-text").textContent = `frame ${done} of ${frames}${left === null ? "" : `, ${inWords(left)} left`}`;
    },
  };
}

/**
 * Rounds a time to the nearest frame, seconds.
 *
 * @type {(time_s: number, fps: number) => number}
 */
export const nearestFrame = (time_s, fps) => Math.max(0, Math.round((1e4 * Math.round(time_s * fps)) / fps) / 1e4);

/**
 * Returns the share of the keyframes' range that is played after some seconds; it starts again at the end.
 *
 * @type {(from: number, played_s: number, frames: number, fps: number) => number}
 */
export const playedShare = (from, played_s, frames, fps) => (played_s / ((frames - 1) / fps || 1) + from) % 1;

/**
 * Returns the displayed length for a range of keyframes and a current time, seconds.
 *
 * @type {(span_s: [number, number] | null, time_s: number) => number}
 */
export function neededLength(span_s, time_s) {
  return Math.max(LEAST_S, Math.ceil((span_s ? span_s[1] : 0) + 1), Math.ceil(time_s));
}

/**
 * Returns the distance of the ruler's marks, seconds: at most twelve fit, except on very long timelines.
 *
 * @type {(length_s: number) => number}
 */
export const rulerStep = (length_s) => [0.5, 1, 2, 5, 10, 30, 60, 300].find((step) => length_s / step <= 12) ?? 600;

/**
 * Describes a remaining time.
 *
 * @type {(left_s: number) => string}
 */
export const inWords = (left_s) => (left_s < 90 ? `${Math.ceil(left_s)} s` : `${Math.ceil(left_s / 60)} min`);
