import assert from "node:assert/strict";
import { test } from "node:test";
import { direction, medianCut } from "../src/median_cut.js";

const [width, height] = [128, 64];

function panorama(radiance) {
  const pixels = new Float32Array(4 * width * height);
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) pixels.set([...radiance(direction(x, y, width, height)), 1], 4 * (y * width + x));
  }
  return pixels;
}

const irradiance = (lights, normal) =>
  lights.reduce((sum, { direction, flux }) => sum + flux[1] * Math.max(0, direction.reduce((dot, value, axis) => dot + value * normal[axis], 0)), 0);

test("directions are those that three.js reads", () => {
  const at = (x, y, z) => {
    const [u, v] = [Math.atan2(z, x) / (2 * Math.PI) + 0.5, Math.asin(y) / Math.PI + 0.5];
    return [Math.floor(u * width) % width, Math.min(Math.floor(v * height), height - 1)];
  };
  for (const axis of [[1, 0, 0], [0, 0, 1], [0, 0, -1], [0.01, 1, 0], [0.6, 0.48, -0.64]]) {
    const length = Math.hypot(...axis);
    const unit = axis.map((value) => value / length);
    const found = direction(...at(...unit), width, height);
    assert.ok(found.reduce((dot, value, index) => dot + value * unit[index], 0) > 0.998, `${axis}: ${found}`);
  }
});

test("even light gives as much energy to each light, and π on every side", () => {
  const lights = medianCut(panorama(() => [1, 1, 1]), width, height, 5);
  assert.equal(lights.length, 32);
  const total = lights.reduce((sum, { flux }) => sum + flux[0], 0);
  assert.ok(Math.abs(total / (4 * Math.PI) - 1) < 1e-3);
  for (const { flux, radius } of lights) {
    assert.ok(flux[0] > (0.6 * total) / 32 && flux[0] < (1.5 * total) / 32, `${flux[0]}`);
    // A cap of the same solid angle.
    assert.ok(Math.abs(2 * Math.PI * (1 - Math.cos(radius)) - flux[0]) < 1e-6);
  }
  for (const normal of [[0, 1, 0], [1, 0, 0], [0, -0.6, 0.8]]) assert.ok(Math.abs(irradiance(lights, normal) / Math.PI - 1) < 0.06);
});

test("a lamp gets most of the lights", () => {
  const lamp = [0.6, 0.8, 0];
  const lights = medianCut(
    panorama((towards) => (towards.reduce((dot, value, axis) => dot + value * lamp[axis], 0) > 0.98 ? [200, 100, 50] : [0.2, 0.2, 0.2])),
    width, height, 5,
  );
  const near = lights.filter(({ direction }) => direction.reduce((dot, value, axis) => dot + value * lamp[axis], 0) > 0.95);
  assert.ok(near.length > 20, `${near.length}`);
  const [red, green] = [0, 1].map((channel) => near.reduce((sum, { flux }) => sum + flux[channel], 0));
  assert.ok(Math.abs(red / green - 2) < 0.05, `${red / green}`);
  // The sides of a lamp's irradiance, in closed form: its flux times the cosine.
  const flux = 100 * 2 * Math.PI * 0.02;
  assert.ok(Math.abs(irradiance(lights, lamp) / (flux + 0.2 * Math.PI) - 1) < 0.06);
});

test("darkness has no lights", () => {
  assert.deepEqual(medianCut(panorama(() => [0, 0, 0]), width, height, 5), []);
});
