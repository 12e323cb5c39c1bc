// The timeline: the playhead, and the keyframes of each animated object.

import { byId, element, fill, short, showMessage } from "./dom.js";

/** Minimum displayed length, seconds. */
const LEAST_S = 5;

/** During playback, a frame that takes longer is skipped, milliseconds. */
const TIMEOUT_MS = 600;

/**
 * Builds the timeline. Returns `show()` to update it, `frameShown()`, and `showDownload(message)` for the progress of a
 * sequence download.
 */
export function timelinePanel(page) {
  const strip = byId("timeline");
  const rows = byId("timeline-rows");
  const playhead = byId("playhead");
  const act = (command) => page.send({ type: "command", command });
  const timeline = () => page.view.timeline;
  let isWanted = false;
  let playing = null;
  let drag = null;
  let length = LEAST_S;

  /** Rounds to the nearest frame. */
  const snapped = (time) => Math.max(0, Math.round(1e4 * Math.round(time * timeline().fps) / timeline().fps) / 1e4);
  const seconds = (time) => `${time.toFixed(2)} s`;

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
    page.seek(snapped(timeline().time_s));
  };
  /** Requests the frame at the clock's current time; earlier ones are skipped. */
  const next = () => {
    const { span_s: span, frames, fps } = timeline();
    if (!playing || !span) return stop();
    const lasts = (frames - 1) / fps || 1;
    const share = ((performance.now() - playing.begun) / 1000 / lasts + playing.from) % 1;
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
  byId("timeline-button").onclick = () => open(strip.hidden);
  byId("play").onclick = play;
  byId("add-key").onclick = addKey;
  byId("stop-sequence").onclick = () => page.send({ type: "stop-film" });
  byId("stage").addEventListener("pointerdown", stop);
  playhead.oninput = () => {
    if (playing) stop();
    page.seek(snapped(playhead.valueAsNumber));
  };
  const sendFrames = () => {
    const count = (field) => (field.value === "" ? null : Math.round(field.valueAsNumber));
    const fps = count(byId("fps"));
    if (fps) act({ do: "frames", frames: count(byId("frames")), fps });
  };
  byId("frames").onchange = byId("fps").onchange = sendFrames;
  byId("interpolation").onchange = () => page.selected()?.path
    && act({ do: "interpolate", object: page.selectedId, interpolation: byId("interpolation").value });

  const timeAt = (event) => {
    const box = rows.querySelector(".track").getBoundingClientRect();
    return snapped(Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1) * length);
  };
  rows.addEventListener("pointerdown", (event) => {
    const key = event.target.closest(".key");
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
  const choose = (object, time) => {
    page.select(object);
    page.seek(time);
  };
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
    const key = event.target.closest(".key");
    if (key && event.detail === 0) choose(Number(key.dataset.object), Number(key.dataset.time));
  });
  strip.addEventListener("keydown", (event) => {
    const key = event.target.closest(".key");
    const name = event.key;
    if (name === "Escape" && drag) end(false);
    else if (key) {
      const [object, time] = [Number(key.dataset.object), Number(key.dataset.time)];
      const step = { ArrowLeft: -1, ArrowRight: 1 }[name];
      if (name === "Delete" || name === "Backspace") act({ do: "delete-key", object, time_s: time });
      else if (step) act({ do: "move-key", object, from_s: time, to_s: snapped(time + step / timeline().fps) });
      else return;
    } else return;
    event.preventDefault();
    event.stopPropagation();
  });

  const showRow = (object) => {
    let row = rows.querySelector(`[data-row="${object.id}"]`);
    if (!row) {
      row = element("div", { className: "row-of-keys", "data-row": String(object.id) },
        element("span", { className: "name" }), element("div", { className: "track" }));
      rows.append(row);
    }
    const [name, track] = row.children;
    name.textContent = object.name;
    row.classList.toggle("selected", object.id === page.selectedId);
    const keys = object.path.keyframes;
    while (track.children.length > keys.length) track.lastChild.remove();
    while (track.children.length < keys.length) track.append(element("button", { className: "key", type: "button" }));
    keys.forEach((key, i) => {
      const button = track.children[i];
      button.style.left = `${(100 * key.time_s) / length}%`;
      button.dataset.object = object.id;
      button.dataset.time = key.time_s;
      button.setAttribute("aria-label", `Keyframe of ${object.name} at ${short(key.time_s)} s`);
      button.title = `${short(key.time_s)} s; drag to move, Delete to remove`;
      button.classList.toggle("now", Math.abs(key.time_s - timeline().time_s) < 1e-4);
    });
  };

  const showRuler = () => {
    const ruler = byId("ruler");
    const step = [0.5, 1, 2, 5, 10, 30, 60, 300, 600].find((each) => length / each <= 12) ?? 600;
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
    const needed = Math.max(LEAST_S, Math.ceil((span ? span[1] : 0) + 1), Math.ceil(time));
    const isNew = !drag && needed !== length;
    if (isNew) length = needed;
    if (isNew || !byId("ruler").childElementCount) showRuler();
    playhead.max = length;
    playhead.step = 1 / fps;
    playhead.value = time;
    playhead.setAttribute("aria-valuetext", seconds(time));
    byId("time").textContent = seconds(time);
    byId("playhead-line").style.left = `${(100 * time) / length}%`;
    const moving = page.view.objects.filter((object) => object.path);
    const ids = new Set(moving.map((object) => String(object.id)));
    for (const row of rows.querySelectorAll("[data-row]")) if (!ids.has(row.dataset.row)) row.remove();
    moving.forEach(showRow);
    byId("timeline-empty").hidden = moving.length > 0;
    byId("add-key").disabled = !page.selected();
    byId("play").disabled = !span || span[0] === span[1];
    fill(byId("frames"), isChosen ? frames : "");
    byId("frames").placeholder = frames;
    fill(byId("fps"), fps);
    byId("interpolation").disabled = !page.selected()?.path;
    fill(byId("interpolation"), page.selected()?.path?.interpolation ?? "linear");
  }

  return {
    show,
    frameShown: () => playing && requestAnimationFrame(next),
    showDownload: ({ done, frames, left_s: left, ended }) => {
      const isOver = ended !== null || done === frames;
      byId("sequence").hidden = isOver;
      if (ended && ended !== "stopped") showMessage(ended, true);
      else if (ended) showMessage("stopped; the downloaded file is incomplete");
      byId("sequence-progress").value = done / frames;
      const rest = left === null ? "" : `, ${left < 90 ? `${Math.ceil(left)} s` : `${Math.ceil(left / 60)} min`} left`;
      byId("sequence-text").textContent = `frame ${done} of ${frames}${rest}`;
    },
  };
}
