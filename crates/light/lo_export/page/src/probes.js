import { direction } from "./median_cut.js";
import { flags, halves } from "./room.js";

/** Steps of the search for what a probe sees where the point sees it. */
const STEPS = 2;
/** Distance in metres where a probe sees nothing. */
const FAR = 50;

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/**
 * Panoramas at the points of a regular grid along three axes, with the distances of what they show. They are in
 * three.js's orientation, from the lowest row.
 */
export class Probes {
  constructor({ axes, origin, spacing, counts, size, free, radiance, distance }) {
    [this.width, this.height] = size;
    this.axes = axes;
    this.origin = origin;
    this.spacing = spacing;
    this.counts = counts;
    this.free = flags(free);
    this.radiance = halves(radiance);
    this.distance = halves(distance).map((value) => (value > 0 ? value : FAR));
    this.panorama = new Float32Array(4 * this.width * this.height).fill(1);
    this.directions = new Float32Array(3 * this.width * this.height);
    for (let pixel = 0; pixel < this.width * this.height; pixel++) {
      this.directions.set(direction(pixel % this.width, Math.floor(pixel / this.width), this.width, this.height), 3 * pixel);
    }
  }

  /**
   * Interpolates the panorama at a point, RGBA. Of each probe, the point sees what is at the probe's distances, and
   * therefore in another direction. The result is overwritten by the next call.
   */
  at(point) {
    const { panorama } = this;
    panorama.fill(0);
    for (const [probe, weight] of this.weights(point)) this.add(probe, weight, point);
    for (let alpha = 3; alpha < panorama.length; alpha += 4) panorama[alpha] = 1;
    return panorama;
  }

  add(probe, weight, point) {
    const { width, height, directions, distance, radiance, panorama } = this;
    const at = this.position(probe);
    const [ox, oy, oz] = point.map((value, axis) => value - at[axis]);
    const first = probe * width * height;
    for (let pixel = 0; pixel < width * height; pixel++) {
      const [dx, dy, dz] = [directions[3 * pixel], directions[3 * pixel + 1], directions[3 * pixel + 2]];
      let far = distance[first + pixel];
      let x, y, z, length;
      for (let step = 0; ; step++) {
        [x, y, z] = [ox + far * dx, oy + far * dy, oz + far * dz];
        length = Math.max(Math.hypot(x, y, z), 1e-6);
        if (step === STEPS) break;
        const [u, v] = this.place(x, y / length, z);
        const seen = distance[first + Math.min(Math.floor(v), height - 1) * width + (Math.floor(u) % width)];
        far *= Math.min(Math.max(seen / length, 0.5), 2);
      }
      const [u, v] = this.place(x, y / length, z);
      // Bilinear, about the centres of pixels.
      const [left, low] = [Math.floor(u - 0.5), Math.floor(v - 0.5)];
      const [right, up] = [u - 0.5 - left, v - 0.5 - low];
      for (let corner = 0; corner < 4; corner++) {
        const [dx, dy] = [corner & 1, corner >> 1];
        const share = weight * (dx ? right : 1 - right) * (dy ? up : 1 - up);
        const row = Math.min(Math.max(low + dy, 0), height - 1);
        const from = 3 * (first + row * width + ((left + dx + width) % width));
        for (let channel = 0; channel < 3; channel++) panorama[4 * pixel + channel] += share * radiance[from + channel];
      }
    }
  }

  /** Column and row of a direction, in pixels from the corner; y is that of the unit vector. */
  place(x, y, z) {
    return [this.width * (Math.atan2(z, x) / (2 * Math.PI) + 0.5), this.height * (Math.asin(Math.min(Math.max(y, -1), 1)) / Math.PI + 0.5)];
  }

  /** The probes around a point and their weights, whose sum is 1. Probes inside of surfaces have none. */
  weights(position) {
    const point = this.axes.map((axis) => dot(axis, position));
    const cells = point.map((value, axis) => {
      const last = this.counts[axis] - 1;
      const at = Math.min(Math.max((value - this.origin[axis]) / this.spacing[axis], 0), last);
      const cell = Math.min(Math.floor(at), Math.max(last - 1, 0));
      return [cell, at - cell];
    });
    const found = [];
    for (let corner = 0; corner < 8; corner++) {
      let weight = 1;
      const cell = cells.map(([cell, share], axis) => {
        const next = (corner >> axis) & 1;
        weight *= next ? share : 1 - share;
        return Math.min(cell + next, this.counts[axis] - 1);
      });
      const probe = this.index(cell);
      if (weight > 1e-6 && this.free[probe]) found.push([probe, weight]);
    }
    if (!found.length) return [[this.nearest(point), 1]];
    const total = found.reduce((sum, [, weight]) => sum + weight, 0);
    return found.map(([probe, weight]) => [probe, weight / total]);
  }

  nearest(point) {
    let best = [0, Infinity];
    for (let probe = 0; probe < this.free.length; probe++) {
      const distance = Math.hypot(...this.position(probe).map((value, axis) => value - point[axis]));
      if (this.free[probe] && distance < best[1]) best = [probe, distance];
    }
    return best[0];
  }

  index([x, y, z]) {
    return (z * this.counts[1] + y) * this.counts[0] + x;
  }

  position(probe) {
    const [nx, ny] = this.counts;
    const cell = [probe % nx, Math.floor(probe / nx) % ny, Math.floor(probe / (nx * ny))];
    const along = cell.map((value, axis) => this.origin[axis] + value * this.spacing[axis]);
    return [0, 1, 2].map((i) => this.axes.reduce((sum, axis, index) => sum + axis[i] * along[index], 0));
  }
}
