import assert from "node:assert/strict";
import { test } from "node:test";
import { DataUtils } from "three";
import { direction } from "../src/median_cut.js";
import { Probes } from "../src/probes.js";

const base64 = (bytes) => Buffer.from(bytes).toString("base64");

const halves = (values) => base64(new Uint8Array(Uint16Array.from(values, DataUtils.toHalfFloat).buffer));

/** Probes that see `radiance(position, direction)`, RGB or one value, at `distance(position, direction)`. */
function probes({ axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], origin = [0, 0, 0], spacing = [1, 1, 1], counts, size = [2, 1], free = () => true, radiance, distance = () => 0 }) {
  const points = [];
  for (let z = 0; z < counts[2]; z++) {
    for (let y = 0; y < counts[1]; y++) {
      for (let x = 0; x < counts[0]; x++) points.push([x, y, z].map((cell, axis) => origin[axis] + cell * spacing[axis]));
    }
  }
  const pixels = Array.from({ length: size[0] * size[1] }, (_, pixel) => direction(pixel % size[0], Math.floor(pixel / size[0]), ...size));
  const all = points.flatMap((point) => pixels.map((towards) => [point, towards]));
  return new Probes({
    axes, origin, spacing, counts, size,
    free: base64(Uint8Array.from(points.map((point) => Number(free(point))))),
    radiance: halves(all.flatMap(([point, towards]) => { const value = radiance(point, towards); return [value, value, value].flat().slice(0, 3); })),
    distance: halves(all.map(([point, towards]) => distance(point, towards))),
  });
}

test("a linear field is interpolated exactly, and kept beyond the grid", () => {
  const field = ([x, y, z]) => 8 + 2 * x - y + 0.5 * z;
  const grid = probes({ origin: [-1, 2, 0], spacing: [0.5, 1, 2], counts: [4, 3, 2], radiance: field });
  for (const point of [[-1, 2, 0], [0.5, 4, 2], [-0.2, 2.7, 1.3]]) {
    const pixel = grid.at(point);
    assert.ok(Math.abs(pixel[0] - field(point)) < 1e-5, `${point}: ${pixel[0]}`);
    assert.deepEqual([...pixel.slice(0, 4)], [...pixel.slice(4, 8)]);
    assert.equal(pixel[3], 1);
  }
  assert.equal(grid.at([-9, 2, 0])[0], field([-1, 2, 0]));
});

test("the axes may be turned", () => {
  const axes = [[0, 1, 0], [-0.6, 0, 0.8], [0.8, 0, 0.6]];
  const grid = probes({ axes, counts: [2, 2, 2], radiance: ([x, y, z]) => x + 2 * y + 4 * z });
  const along = [0.25, 0.5, 0.75];
  const position = [0, 1, 2].map((i) => axes.reduce((sum, axis, index) => sum + axis[i] * along[index], 0));
  assert.ok(Math.abs(grid.at(position)[0] - 4.25) < 1e-5);
});

test("probes inside of surfaces are left out", () => {
  const grid = probes({ counts: [2, 1, 1], free: ([x]) => x === 1, radiance: ([x]) => 1 + x });
  assert.equal(grid.at([0.1, 0, 0])[0], 2);
  // Where none of the neighbours is free, the nearest one is taken.
  const walled = probes({ counts: [4, 1, 1], free: ([x]) => x === 3, radiance: ([x]) => 1 + x });
  assert.equal(walled.at([0.5, 0, 0])[0], 4);
});

test("a plane of probes has no thickness", () => {
  const grid = probes({ counts: [2, 1, 2], radiance: ([x, , z]) => x + z });
  assert.equal(grid.at([0.5, 7, 0.5])[0], 1);
});

test("a point sees what is there, not what the probe sees in the same direction", () => {
  // A room of 4 m with probes 1 m apart; its walls are brighter the higher they are.
  const wall = (from, towards) => Math.min(...towards.map((value, axis) => (Math.sign(value) * 2 - from[axis]) / value));
  const seen = (from, towards) => 2 + from[1] + wall(from, towards) * towards[1];
  const grid = probes({ origin: [-0.5, -0.5, -0.5], counts: [2, 2, 2], size: [64, 32], radiance: seen, distance: wall });
  const error = (point, panorama) => {
    let sum = 0;
    for (let pixel = 0; pixel < 64 * 32; pixel++) {
      const towards = [0, 1, 2].map((axis) => grid.directions[3 * pixel + axis]);
      sum += (panorama[4 * pixel] - seen(point, towards)) ** 2;
    }
    return Math.sqrt(sum / (64 * 32));
  };
  for (const point of [[0, 0, 0], [0.3, -0.2, 0.1]]) {
    const found = error(point, grid.at(point));
    assert.ok(found < 0.05, `${point}: ${found}`);
    // Without distances it is that of the direction.
    const plain = probes({ origin: [-0.5, -0.5, -0.5], counts: [2, 2, 2], size: [64, 32], radiance: seen });
    assert.ok(error(point, plain.at(point)) > 2 * found);
  }
});
