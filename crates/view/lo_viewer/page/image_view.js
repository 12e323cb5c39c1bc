// The displayed image: the newest frame with exposure, false colour and overlays.

import { coded, contextOf, linear } from "./dom.js";

/** @import { Pixel } from "./camera.js" */
/** @import { Frame } from "./store.js" */

/** Quality of a frame: a better one of the same change replaces a worse one. */
const RANK = { moving: 0, resting: 1, final: 2 };

/** Upper ends of the false-colour bands, in stops relative to middle grey (18 % of white). */
/** @type {[number, [number, number, number], string][]} */
const BANDS = [
  [-5, [70, 30, 110], "black: below −5 stops"],
  [-3, [50, 80, 190], "−5 to −3"],
  [-1.5, [40, 140, 190], "−3 to −1.5"],
  [-0.5, [70, 110, 110], "−1.5 to −0.5"],
  [0.5, [60, 170, 80], "middle grey ± 0.5"],
  [1.5, [225, 140, 185], "+0.5 to +1.5"],
  [2.3, [240, 220, 70], "+1.5 to +2.3"],
  [Infinity, [230, 60, 50], "white: clipped"],
];

/** @type {[string, string][]} */
export const LUMINANCE_LEGEND = BANDS.map(([, color, text]) => [`rgb(${color.join(" ")})`, text]);

export class ImageView {
  /**
   * Draws into a canvas; `drawn(frame)` is called when a frame is shown.
   *
   * @param {HTMLCanvasElement} canvas
   * @param {(frame: Frame) => void} drawn
   */
  constructor(canvas, drawn) {
    this.canvas = canvas;
    this.context = contextOf(canvas);
    this.drawn = drawn;
    this.exposure = 0;
    this.isFalseColour = false;
    /** @type {ImageBitmap | null} */
    this.overlay = null;
    /**
     * Canvas of the photo with a patch.
     *
     * @type {OffscreenCanvas | null}
     */
    this.work = null;
    this.reset();
  }

  /** Clears the view for another scene. */
  reset() {
    /** @type {Frame | null} */
    this.shown = null;
    /** @type {ImageBitmap | OffscreenCanvas | null} */
    this.bitmap = null;
    /** @type {ImageBitmap | null} */
    this.photo = null;
  }

  /**
   * Sets the photo that patches are laid over.
   *
   * @param {BlobPart} bytes
   */
  async setPhoto(bytes) {
    this.photo = await createImageBitmap(new Blob([bytes], { type: "image/jpeg" }));
  }

  /**
   * Shows a received frame, unless a newer or better one is shown.
   *
   * @param {Frame} frame
   * @param {BlobPart} bytes
   */
  async take(frame, bytes) {
    const patch = await createImageBitmap(new Blob([bytes], { type: frame.mime }));
    const before = this.shown;
    const isOlder = before && (frame.change < before.change
      || (frame.change === before.change && RANK[frame.step] < RANK[before.step]));
    if (isOlder || (frame.at && !this.photo)) {
      patch.close();
      return;
    }
    const bitmap = frame.at && this.photo ? this.composited(this.photo, patch, frame.at) : patch;
    if (this.bitmap !== bitmap && this.bitmap instanceof ImageBitmap) this.bitmap.close();
    [this.shown, this.bitmap] = [frame, bitmap];
    this.draw();
    this.drawn(frame);
  }

  /**
   * Returns a photo with a patch on it.
   *
   * @param {ImageBitmap} photo
   * @param {ImageBitmap} patch
   * @param {Pixel} position
   */
  composited(photo, patch, [x, y]) {
    const { width, height } = photo;
    if (this.work?.width !== width || this.work?.height !== height) this.work = new OffscreenCanvas(width, height);
    const context = contextOf(this.work);
    context.drawImage(photo, 0, 0);
    context.drawImage(patch, x, y);
    patch.close();
    return this.work;
  }

  /**
   * Sets or removes the overlay.
   *
   * @param {ImageBitmap | null} overlay
   */
  setOverlay(overlay) {
    this.overlay?.close();
    this.overlay = overlay;
    this.draw();
  }

  draw() {
    const { context, canvas, bitmap } = this;
    if (!bitmap) {
      context.clearRect(0, 0, canvas.width, canvas.height);
      return;
    }
    context.imageSmoothingQuality = this.shown?.at ? "low" : "high";
    context.drawImage(this.developed(bitmap), 0, 0, canvas.width, canvas.height);
    if (this.overlay) context.drawImage(this.overlay, 0, 0, canvas.width, canvas.height);
  }

  /**
   * Returns the frame with exposure or false colour applied.
   *
   * @param {ImageBitmap | OffscreenCanvas} bitmap
   */
  developed(bitmap) {
    if (this.exposure === 0 && !this.isFalseColour) return bitmap;
    // At the displayed resolution.
    const scale = Math.min(1, this.canvas.width / bitmap.width);
    const [width, height] = [Math.round(bitmap.width * scale), Math.round(bitmap.height * scale)];
    const work = new OffscreenCanvas(width, height);
    const context = contextOf(work, { willReadFrequently: true });
    context.drawImage(bitmap, 0, 0, width, height);
    const image = context.getImageData(0, 0, width, height);
    (this.isFalseColour ? falseColour : brightened)(image.data, 2 ** this.exposure);
    context.putImageData(image, 0, 0);
    return work;
  }
}

/** @type {(data: Uint8ClampedArray, gain: number) => void} */
function brightened(data, gain) {
  const table = new Uint8ClampedArray(256);
  for (let code = 0; code < 256; code++) table[code] = Math.round(255 * coded(Math.min(linear(code / 255) * gain, 1)));
  for (let i = 0; i < data.length; i += 4) {
    data[i] = table[data[i]];
    data[i + 1] = table[data[i + 1]];
    data[i + 2] = table[data[i + 2]];
  }
}

/**
 * Replaces sRGB codes by the false colour of luminance times a gain, in place.
 *
 * @type {(data: Uint8ClampedArray, gain: number) => void}
 */
export function falseColour(data, gain) {
  const table = new Float32Array(256);
  for (let code = 0; code < 256; code++) table[code] = linear(code / 255) * gain;
  const limits = BANDS.map(([stops]) => 0.18 * 2 ** stops);
  for (let i = 0; i < data.length; i += 4) {
    const luminance = 0.2126 * table[data[i]] + 0.7152 * table[data[i + 1]] + 0.0722 * table[data[i + 2]];
    let band = 0;
    while (luminance >= limits[band]) band++;
    [data[i], data[i + 1], data[i + 2]] = BANDS[band][1];
  }
}
