// Zoom and pan of the photo: which part of it the stage shows, and where.

/** @import { Pixel } from "./camera.js" */

/** @typedef {{ width: number, height: number }} Size */

/**
 * A part of the photo on the stage.
 *
 * @typedef {object} Shown
 * @property {number} scale CSS pixels per photo pixel.
 * @property {number} left CSS pixels from the stage's left edge.
 * @property {number} top CSS pixels from the stage's top edge.
 * @property {number} width CSS pixels.
 * @property {number} height CSS pixels.
 * @property {Pixel} origin Photo position of the left upper corner.
 */

/** Largest magnification, CSS pixels per photo pixel: single pixels are visible. */
const MAX_SCALE = 24;

/** @type {(value: number, low: number, high: number) => number} */
const clamped = (value, low, high) => Math.min(Math.max(value, low), Math.max(low, high));

/** Zoom 1 shows the whole photo. The centre is a photo position. */
export class PhotoView {
  constructor() {
    /** @type {Size} */
    this.photo = { width: 1, height: 1 };
    /** @type {Size} */
    this.stage = { width: 1, height: 1 };
    this.zoom = 1;
    /** @type {Pixel} */
    this.centre = [0.5, 0.5];
  }

  /** Shows the whole photo. */
  reset() {
    this.zoom = 1;
    this.centre = [this.photo.width / 2, this.photo.height / 2];
  }

  /**
   * Sets the sizes of photo and stage.
   *
   * @type {(photo: Size, stage: Size) => void}
   */
  resize(photo, stage) {
    const isOther = photo.width !== this.photo.width || photo.height !== this.photo.height;
    [this.photo, this.stage] = [photo, stage];
    if (isOther) this.reset();
    this.zoomTo(this.zoom);
  }

  /** Returns the scale at which the whole photo fits. */
  fit() {
    return Math.min(this.stage.width / this.photo.width, this.stage.height / this.photo.height);
  }

  /**
   * Returns what is shown.
   *
   * @returns {Shown}
   */
  shown() {
    const scale = this.fit() * this.zoom;
    /** @type {(photo: number, stage: number, centre: number) => [number, number, number]} */
    const along = (photo, stage, centre) => {
      const length = photo * scale;
      // Tolerance of rounding at zoom 1.
      if (length <= stage * (1 + 1e-9)) return [(stage - length) / 2, length, 0];
      return [0, stage, clamped(centre - stage / scale / 2, 0, photo - stage / scale)];
    };
    const [left, width, u] = along(this.photo.width, this.stage.width, this.centre[0]);
    const [top, height, v] = along(this.photo.height, this.stage.height, this.centre[1]);
    return { scale, left, top, width, height, origin: [u, v] };
  }

  /**
   * Sets the zoom within its limits.
   *
   * @param {number} zoom
   */
  zoomTo(zoom) {
    this.zoom = clamped(zoom, 1, MAX_SCALE / this.fit());
    this.keepInside();
  }

  /**
   * Zooms by a factor so that the photo position at a point of the stage stays there.
   *
   * @type {(factor: number, at: [number, number]) => void}
   */
  zoomAt(factor, at) {
    const [u, v] = this.photoPosition(at);
    this.zoomTo(this.zoom * factor);
    const { scale } = this.shown();
    this.centre = [u + (this.stage.width / 2 - at[0]) / scale, v + (this.stage.height / 2 - at[1]) / scale];
    this.keepInside();
  }

  /**
   * Moves the photo by CSS pixels.
   *
   * @type {(right: number, down: number) => void}
   */
  pan(right, down) {
    const { scale } = this.shown();
    this.centre = [this.centre[0] - right / scale, this.centre[1] - down / scale];
    this.keepInside();
  }

  /**
   * Returns the photo position at a point of the stage.
   *
   * @param {[number, number]} at CSS pixels.
   * @returns {Pixel}
   */
  photoPosition(at) {
    const { scale, left, top, origin } = this.shown();
    return [origin[0] + (at[0] - left) / scale, origin[1] + (at[1] - top) / scale];
  }

  /** Moves the centre so that the photo covers as much of the stage as it can. */
  keepInside() {
    const { scale } = this.shown();
    /** @type {(centre: number, photo: number, stage: number) => number} */
    const inside = (centre, photo, stage) => {
      const half = Math.min(stage / scale, photo) / 2;
      return clamped(centre, half, photo - half);
    };
    this.centre = [
      inside(this.centre[0], this.photo.width, this.stage.width),
      inside(this.centre[1], this.photo.height, this.stage.height),
    ];
  }
}
