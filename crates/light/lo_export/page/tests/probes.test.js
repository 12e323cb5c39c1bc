import assert from "node:assert/strict";
import { test } from "node:test";
import { DataUtils } from "three";
import { Probes } from "../src/probes.js";

const base64 = (bytes) => Buffer.from(bytes).toString("base64");

/** Probes whose panorama of 2 × 1 has the value of `radiance` at their position. */
function probes({ origin = [0, 0, 0], spacing = [1, 1, 1], counts, free = () => true, radiance }) {
  const points = [];
  for (let z = 0; z < counts[2]; z++) {
    for (let y = 0; y < counts[1]; y++) {
      for (let x = 0; x < counts[0]; x++) points.push([x, y, z].map((cell, axis) => origin[axis] + cell * spacing[axis]));
    }
  }
  const halves = Uint16Array.from(points.flatMap((point) => Array(6).fill(DataUtils.toHalfFloat(radiance(point)))));
  return new Probes({
    origin, spacing, counts, size: [2, 1],
    free: base64(Uint8Array.from(points.map((point) => Number(free(point))))),
    radiance: base64(new Uint8Array(halves.buffer)),
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
