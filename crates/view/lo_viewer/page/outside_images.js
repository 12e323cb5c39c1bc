// Requests for the program's images of the room from outside: small ones during a movement, one of full size at rest.

/** @import { Page } from "./store.js" */
/** @import { OutsideView, ToPage } from "./protocol.d.ts" */

/**
 * A view is at rest when it has not changed for this long; a response that takes longer than this is given up.
 * Milliseconds.
 */
const REST_MS = 150;
const TIMEOUT_MS = 3000;

/**
 * @typedef {object} OutsideImage
 * @property {number} sequence
 * @property {OutsideView} view
 * @property {ImageBitmap} bitmap
 * @property {number} took_ms Rendering time.
 * @property {OffscreenCanvas | null} developed The image in false colour, when it was needed.
 */

/**
 * @typedef {object} OutsideHooks
 * @property {() => boolean} isOn
 * @property {(still: boolean) => OutsideView} viewOf
 * @property {() => void} arrived
 * @property {() => void} rested
 */

/**
 * Manages requests. `isOn()` returns whether images are wanted, `viewOf(still)` the `OutsideView` to request,
 * `arrived()` is called when an image is shown, and `rested()` when a view comes to rest.
 *
 * Returns `again()` to request the current view, `take(message, bytes)` for responses, `reset()`, `isStill()` and
 * `shown`, the shown image or null.
 *
 * @param {Pick<Page, "send">} page
 * @param {OutsideHooks} hooks
 */
export function outsideImages(page, { isOn, viewOf, arrived, rested }) {
  let sequence = 0;
  /** @type {Map<number, OutsideView>} */
  const requested = new Map();
  /**
   * Sequence number of the pending request of a movement.
   *
   * @type {number | null}
   */
  let pending = null;
  let isWanted = false;
  let stillTimer = 0;
  let timeout = 0;

  const images = {
    shown: /** @type {OutsideImage | null} */ (null),
    isStill: () => Boolean(images.shown?.view.still && images.shown.sequence === sequence),
    again() {
      if (!isOn()) return;
      isWanted = true;
      requestMoving();
      clearTimeout(stillTimer);
      stillTimer = setTimeout(requestStill, REST_MS);
    },
    reset() {
      images.shown = null;
      pending = null;
    },
    /**
     * @param {Extract<ToPage, { type: "outside" }>} message
     * @param {BlobPart} bytes
     */
    async take({ sequence: number, mime, took_ms }, bytes) {
      const view = requested.get(number);
      for (const older of requested.keys()) if (older <= number) requested.delete(older);
      if (number === pending) {
        pending = null;
        clearTimeout(timeout);
        if (isWanted) requestMoving();
      }
      const bitmap = await createImageBitmap(new Blob([bytes], { type: mime }));
      if (!view || number < (images.shown?.sequence ?? 0)) return bitmap.close();
      images.shown?.bitmap.close();
      images.shown = { sequence: number, view, bitmap, took_ms, developed: null };
      arrived();
      return undefined;
    },
  };

  /** @param {boolean} still */
  function request(still) {
    const view = viewOf(still);
    sequence += 1;
    requested.set(sequence, view);
    page.send({ type: "outside", sequence, view });
    return sequence;
  }

  // One request at a time during a movement: the newest view waits for the response to the last.
  function requestMoving() {
    if (pending !== null) return;
    isWanted = false;
    pending = request(false);
    clearTimeout(timeout);
    timeout = setTimeout(() => {
      pending = null;
      if (isWanted && isOn()) requestMoving();
    }, TIMEOUT_MS);
  }

  function requestStill() {
    if (!isOn()) return;
    // Never while another image is pending, which it would replace.
    if (pending !== null) stillTimer = setTimeout(requestStill, REST_MS);
    else request(true);
    rested();
  }

  return images;
}
