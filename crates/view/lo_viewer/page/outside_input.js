// Pointer and keys on the view from outside.

import { around } from "./dom.js";
import { clamped } from "./orbit.js";

/**
 * @typedef {object} OutsideActions
 * @property {(yaw: number, pitch: number) => void} rotate
 * @property {(right: number, up: number) => void} pan
 * @property {(factor: number) => void} zoom
 * @property {() => void} resetView
 * @property {() => void} centre
 * @property {(event: MouseEvent) => void} click
 * @property {(event: PointerEvent) => OutsideGrab | null} grab Starts to drag what is at the pointer.
 */

/** @typedef {{ move: (event: PointerEvent) => void, end: (isKept: boolean) => void }} OutsideGrab */

/**
 * Listens to the canvas and the keyboard while `isActive()`. `actions`: `rotate(yaw, pitch)` in degrees, `pan(right,
 * up)` in shares of the height, `zoom(factor)`, `resetView()`, `centre()`, `click(event)`, and `grab(event)`.
 *
 * @param {HTMLElement} stage
 * @param {HTMLCanvasElement} canvas
 * @param {() => boolean} isActive
 * @param {OutsideActions} actions
 */
export function listenOutside(stage, canvas, isActive, actions) {
  const { rotate, pan, zoom, resetView, centre, click, grab } = actions;
  /** @type {OutsideGrab | null} */
  let grabbed = null;

  // Events stop here: on the stage below they would move objects in the photo.
  /** @type {{ at: [number, number], isPan: boolean, moved: number } | null} */
  let drag = null;
  /**
   * @template {keyof HTMLElementEventMap} Kind
   * @param {Kind} kind
   * @param {(event: HTMLElementEventMap[Kind]) => void} action
   */
  const on = (kind, action) => canvas.addEventListener(kind, (event) => {
    event.stopPropagation();
    if (isActive()) action(event);
  });
  on("pointerdown", (event) => {
    event.preventDefault();
    stage.focus();
    canvas.setPointerCapture(event.pointerId);
    grabbed = event.button === 0 ? grab(event) : null;
    if (grabbed) return;
    drag = { at: [event.clientX, event.clientY], isPan: event.button !== 0 || event.shiftKey, moved: 0 };
  });
  on("pointermove", (event) => {
    grabbed?.move(event);
    if (!drag) return;
    const [dx, dy] = [event.clientX - drag.at[0], event.clientY - drag.at[1]];
    drag.at = [event.clientX, event.clientY];
    drag.moved += Math.abs(dx) + Math.abs(dy);
    const { height } = canvas.getBoundingClientRect();
    if (drag.isPan) pan(-dx / height, dy / height);
    else rotate((-200 * dx) / height, (200 * dy) / height);
  });
  /** @param {PointerEvent} event */
  const end = (event) => {
    grabbed?.end(event.type === "pointerup");
    if (drag && drag.moved < 4 && event.type === "pointerup" && event.button === 0) click(event);
    drag = grabbed = null;
  };
  on("pointerup", end);
  on("pointercancel", end);
  on("contextmenu", (event) => event.preventDefault());
  on("dblclick", resetView);
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    if (isActive()) zoom(Math.exp(clamped(event.deltaY, -300, 300) / 700));
  }, { passive: false });

  /**
   * Without and with Shift.
   *
   * @type {Record<string, (() => void)[]>}
   */
  const keys = {
    ArrowLeft: [() => rotate(-5, 0), () => pan(-0.05, 0)],
    ArrowRight: [() => rotate(5, 0), () => pan(0.05, 0)],
    ArrowUp: [() => rotate(0, 5), () => pan(0, 0.05)],
    ArrowDown: [() => rotate(0, -5), () => pan(0, -0.05)],
    Home: [resetView],
    "+": [() => zoom(1 / 1.1)],
    "=": [() => zoom(1 / 1.1)],
    "-": [() => zoom(1.1)],
    c: [centre],
  };
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !grabbed) return;
    grabbed.end(false);
    grabbed = null;
    event.stopPropagation();
  }, true);
  // Captured before the photo's keys, some of which are the same.
  document.addEventListener("keydown", (event) => {
    if (canvas.hidden || !isActive() || event.ctrlKey || event.metaKey || event.altKey) return;
    const key = keys[event.key] ?? keys[event.key.toLowerCase()];
    if (!key || around(event, "input, select, textarea, dialog[open], aside, header, footer")) return;
    event.preventDefault();
    event.stopPropagation();
    (event.shiftKey && key[1] ? key[1] : key[0])();
  }, true);
}
