import { flags, halves } from "./room.js";

/** Panoramas at the points of a regular grid. They are in three.js's orientation, from the lowest row. */
export class Probes {
  constructor({ origin, spacing, counts, size, free, radiance }) {
    [this.width, this.height] = size;
    this.origin = origin;
    this.spacing = spacing;
    this.counts = counts;
    this.free = flags(free);
    this.radiance = halves(radiance);
    this.panorama = new Float32Array(4 * this.width * this.height).fill(1);
  }

  /** Interpolates the panorama at a point, RGBA. The result is overwritten by the next call. */
  at(point) {
    const weights = this.weights(point);
    const pixels = this.width * this.height;
    for (let pixel = 0; pixel < pixels; pixel++) {
      for (let channel = 0; channel < 3; channel++) {
        let sum = 0;
        for (const [probe, weight] of weights) sum += weight * this.radiance[3 * (probe * pixels + pixel) + channel];
        this.panorama[4 * pixel + channel] = sum;
      }
    }
    return this.panorama;
  }

  /** The probes around a point and their weights, whose sum is 1. Probes inside of surfaces have none. */
  weights(point) {
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
    return cell.map((value, axis) => this.origin[axis] + value * this.spacing[axis]);
  }
}
