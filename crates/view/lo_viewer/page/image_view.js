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
    /** The part of the image that the canvas shows, as shares of its width and height. */
    this.region = { x: 0, y: 0, width: 1, height: 1 };
    /** Whether pixels are so large that their edges are to be seen. */
    this.isMagnified = false;
    /**
     * Share of the canvas, from the left, that shows the photo as taken.
     *
     * @type {number | null}
     */
    this.wipe = null;
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
    /**
     * The photo at full size, for the wipe.
     *
     * @type {ImageBitmap | null}
     */
    this.original = null;
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
    context.clearRect(0, 0, canvas.width, canvas.height);
    if (!bitmap) return;
    this.drawPart(bitmap, 1);
    const before = this.original ?? this.photo;
    if (this.wipe !== null && before) this.drawPart(before, this.wipe);
    if (this.exposure !== 0 || this.isFalseColour) {
      const image = context.getImageData(0, 0, canvas.width, canvas.height);
      (this.isFalseColour ? falseColour : brightened)(image.data, 2 ** this.exposure);
      context.putImageData(image, 0, 0);
    }
    if (this.overlay) this.drawPart(this.overlay, 1);
  }

  /**
   * Draws the shown region of an image, of which the canvas shows a share from the left.
   *
   * @param {ImageBitmap | OffscreenCanvas} image
   * @param {number} share
   */
  drawPart(image, share) {
    const { context, canvas, region } = this;
    const [width, height] = [canvas.width * share, canvas.height];
    if (width <= 0) return;
    context.imageSmoothingEnabled = !(this.isMagnified && image.width * region.width * 3 < canvas.width);
    context.imageSmoothingQuality = this.shown?.at ? "low" : "high";
    context.drawImage(image, region.x * image.width, region.y * image.height, region.width * share * image.width,
      region.height * image.height, 0, 0, width, height);
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
