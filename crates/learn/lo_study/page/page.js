// Plays the pairs of a study, and keeps the answers in the browser until the participant saves them.
"use strict";
(() => {
  /** @type {{ id: string, fps: number, frames: string[], pairs: { id: string, videos: [string, string, string] }[] }} */
  const study = globalThis.study;

  /** Time without videos between two pairs, milliseconds. */
  const BLANK_MS = 400;
  /** Largest enlargement of a video. */
  const MAX_ENLARGEMENT = 2;
  const COLUMNS = "study,participant,pair,position,choice,seconds";

  const byId = (id) => document.getElementById(id);
  const screens = ["welcome", "pair", "end", "failure"];
  const canvases = [...document.querySelectorAll("canvas")];

  /** Participant, order of the pairs, and answers. Only the answers are stored: the order follows from the code. */
  let session = null;
  /** What is playing, or null: its frames, its beginning, and whether it may be answered. */
  let playing = null;
  /** Frames of the pair to come, by its position. */
  let prefetched = null;
  /** Size of the current videos, pixels. */
  let size = { width: 3, height: 2 };

  function show(screen) {
    for (const id of screens) byId(id).hidden = id !== screen;
  }

  function fail(reason) {
    playing = null;
    byId("reason").textContent = reason;
    show("failure");
  }

  // Storage. Without it (some browsers refuse it to files) the study works, but not over a reload.

  const storageKey = (name) => `lightoctree-study:${study.id}:${name}`;
  const answersOf = (participant) => `answers:${participant}`;

  function store(name, value) {
    try {
      localStorage.setItem(storageKey(name), JSON.stringify(value));
      return true;
    } catch {
      return false;
    }
  }

  function stored(name) {
    try {
      return JSON.parse(localStorage.getItem(storageKey(name)));
    } catch {
      return null;
    }
  }

  // Order of the pairs: at random, the same for the same participant.

  /** Returns a generator of numbers in [0, 1): mulberry32, seeded by FNV-1a. */
  function randomOf(text) {
    let state = 0x811c9dc5;
    for (const byte of new TextEncoder().encode(text)) state = Math.imul(state ^ byte, 0x01000193) >>> 0;
    return () => {
      state = (state + 0x6d2b79f5) >>> 0;
      let mixed = Math.imul(state ^ (state >>> 15), state | 1);
      mixed = (mixed + Math.imul(mixed ^ (mixed >>> 7), mixed | 61)) ^ mixed;
      return ((mixed ^ (mixed >>> 14)) >>> 0) / 2 ** 32;
    };
  }

  function shuffled(count, random) {
    const order = [...Array(count).keys()];
    for (let i = count - 1; i > 0; i--) {
      const j = Math.floor(random() * (i + 1));
      [order[i], order[j]] = [order[j], order[i]];
    }
    return order;
  }

  function randomCode() {
    return [...crypto.getRandomValues(new Uint8Array(4))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
  }

  // Videos: images drawn to canvases, all three in the same frame of the screen.

  async function loadFrame(path) {
    const image = new Image();
    image.src = path;
    try {
      await image.decode();
    } catch {
      throw new Error(`${path} is missing or damaged.`);
    }
    return createImageBitmap(image);
  }

  async function loadPair(position) {
    const { videos } = study.pairs[session.order[position]];
    const video = (folder) => Promise.all(study.frames.map((name) => loadFrame(`${folder}/${name}`)));
    return Promise.all(videos.map(video));
  }

  function prefetch(position) {
    if (position >= session.order.length) return;
    prefetched = { position, videos: loadPair(position) };
    // Reported when the pair is shown.
    prefetched.videos.catch(() => {});
  }

  /** Returns the frame at a time since the beginning: forth, and back without repeating the ends. */
  function frameAt(elapsed_ms) {
    const last = study.frames.length - 1;
    const step = Math.floor((elapsed_ms * study.fps) / 1000) % (2 * last);
    return step <= last ? step : 2 * last - step;
  }

  const loop_ms = (2 * (study.frames.length - 1) * 1000) / study.fps;

  function draw(now) {
    if (playing === null) return;
    requestAnimationFrame(draw);
    if (playing.begun === null) {
      playing.begun = now;
      playing.first ??= now;
    }
    const elapsed_ms = Math.max(now - playing.begun, 0);
    const frame = frameAt(elapsed_ms);
    if (frame !== playing.shown) {
      canvases.forEach((canvas, side) => {
        canvas.getContext("2d", { alpha: false }).drawImage(playing.videos[side][frame], 0, 0);
        canvas.dataset.frame = String(frame);
      });
      playing.shown = frame;
      byId("videos").classList.remove("blank");
    }
    if (!playing.isAnswerable && elapsed_ms >= loop_ms) allowAnswer();
  }

  function replay() {
    if (playing !== null) playing.begun = null;
  }

  // Pairs.

  function allowAnswer() {
    playing.isAnswerable = true;
    byId("left").disabled = byId("right").disabled = false;
    byId("hint").textContent = "Press ← or → to answer.";
  }

  async function showPair() {
    const own = session;
    const position = session.answers.length;
    const count = session.order.length;
    if (position === count) {
      byId("saved").textContent = "";
      show("end");
      return;
    }
    byId("progress").textContent = `Pair ${position + 1} of ${count}`;
    byId("bar").max = count;
    byId("bar").value = position;
    byId("left").disabled = byId("right").disabled = true;
    byId("save-early").hidden = position === 0;
    byId("videos").classList.add("blank");
    byId("hint").textContent = "Loading …";
    show("pair");
    try {
      if (prefetched?.position !== position) prefetch(position);
      const loading = prefetched.videos;
      const [videos] = await Promise.all([loading, new Promise((resolve) => setTimeout(resolve, BLANK_MS))]);
      if (session !== own) return;
      byId("hint").textContent = "Watch the videos once to the end.";
      size = { width: videos[0][0].width, height: videos[0][0].height };
      for (const canvas of canvases) Object.assign(canvas, size);
      fit();
      playing = { videos, begun: null, first: null, shown: null, isAnswerable: false };
      requestAnimationFrame(draw);
      prefetch(position + 1);
    } catch (error) {
      fail(`${error.message} Copy the complete folder of the study, and reload the page: your answers are kept.`);
    }
  }

  function answer(choice) {
    if (!playing?.isAnswerable) return;
    const seconds = (performance.now() - playing.first) / 1000;
    const pair = study.pairs[session.order[session.answers.length]].id;
    session.answers.push({ pair, choice, seconds });
    store(answersOf(session.participant), session.answers);
    for (const bitmap of playing.videos.flat()) bitmap.close();
    playing = null;
    showPair();
  }

  // Answers.

  function csv() {
    const row = ({ pair, choice, seconds }, i) =>
      [study.id, session.participant, pair, i + 1, choice, seconds.toFixed(2)].join(",");
    return [COLUMNS, ...session.answers.map(row)].join("\r\n") + "\r\n";
  }

  function save() {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([csv()], { type: "text/csv" }));
    link.download = `answers-${study.id}-${session.participant}.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
    byId("saved").textContent = `Saved as ${link.download} in the folder of your downloads.`;
  }

  // Participants.

  function welcome() {
    session = playing = prefetched = null;
    byId("count").textContent = String(study.pairs.length);
    const field = byId("participant");
    field.value = stored("current") ?? randomCode();
    describeResumption();
    show("welcome");
    field.focus();
    field.select();
  }

  function describeResumption() {
    const count = stored(answersOf(byId("participant").value.trim()))?.length ?? 0;
    byId("resumed").hidden = count === 0;
    byId("resumed").textContent = `${count} of ${study.pairs.length} pairs are answered; the study continues after them.`;
  }

  function begin(event) {
    event.preventDefault();
    const participant = byId("participant").value.trim();
    const order = shuffled(study.pairs.length, randomOf(`${study.id} ${participant}`));
    session = { participant, order, answers: stored(answersOf(participant)) ?? [] };
    byId("unkept").hidden = store("current", participant) && store(answersOf(participant), session.answers);
    document.activeElement?.blur();
    showPair();
  }

  function nextParticipant() {
    store("current", null);
    welcome();
  }

  // Input.

  /** Makes the videos as large as the window allows. */
  function fit() {
    const area = byId("videos").getBoundingClientRect();
    const room = { width: (area.width - 40) / 3, height: area.height - 60 };
    const scale = Math.min(room.width / size.width, room.height / size.height, MAX_ENLARGEMENT);
    for (const canvas of canvases) canvas.style.inlineSize = `${Math.floor(scale * size.width)}px`;
  }

  function onKey(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === "Enter" && event.target instanceof HTMLButtonElement) return;
    const actions = byId("pair").hidden
      ? byId("end").hidden
        ? {}
        : { Enter: save }
      : { ArrowLeft: () => answer("left"), ArrowRight: () => answer("right"), " ": replay };
    const action = actions[event.key];
    if (action === undefined) return;
    event.preventDefault();
    if (!event.repeat) action();
  }

  if (study === undefined) {
    fail("study.js is missing. Copy the complete folder of the study.");
    return;
  }
  addEventListener("keydown", onKey);
  addEventListener("resize", fit);
  // A hidden page draws nothing: its videos begin again.
  document.addEventListener("visibilitychange", () => document.hidden || replay());
  byId("start").addEventListener("submit", begin);
  byId("participant").addEventListener("input", describeResumption);
  for (const side of ["left", "right"]) byId(side).addEventListener("click", () => answer(side));
  for (const [id, action] of Object.entries({ replay, save, "save-early": save, "next-participant": nextParticipant })) {
    byId(id).addEventListener("click", (event) => {
      action();
      // Space and Enter are keys of the page, not of the button that was pressed last.
      event.currentTarget.blur();
    });
  }
  welcome();
})();
