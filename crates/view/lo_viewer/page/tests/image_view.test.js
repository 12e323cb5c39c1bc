import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { linear } from "../dom.js";
import { ImageView, LUMINANCE_LEGEND, falseColour } from "../image_view.js";
import { FakeCanvas, installCanvas } from "./support/canvas.js";

let view;
let drawn;

/** A frame; `text` is the content of its image. */
const take = async (change, step, text, at = null) => {
  await view.take({ type: "frame", change, sequence: 0, step, mime: "image/jpeg", at, lengths: [text.length], took_ms: 1 }, text);
  return view.bitmap?.text;
};

beforeEach(() => {
  installCanvas();
  drawn = [];
  view = new ImageView(new FakeCanvas(400, 300), ({ change, step }) => drawn.push(`${change} ${step}`));
});

test("an image of an older change is dropped", async () => {
  assert.equal(await take(2, "moving", "second"), "second");
  assert.equal(await take(1, "final", "first"), "second");
  assert.equal(await take(3, "moving", "third"), "third");
  assert.deepEqual(drawn, ["2 moving", "3 moving"]);
});

test("a better image of the same change replaces a worse one, not vice versa", async () => {
  assert.equal(await take(1, "resting", "resting"), "resting");
  assert.equal(await take(1, "moving", "draft"), "resting");
  assert.equal(await take(1, "final", "final"), "final");
  assert.deepEqual(drawn, ["1 resting", "1 final"]);
});

test("images that decode in another order leave the newest one", async () => {
  const decode = globalThis.createImageBitmap;
  let release;
  globalThis.createImageBitmap = async (blob) => {
    if (await blob.text() === "slow") await new Promise((resolve) => { release = resolve; });
    return decode(blob);
  };
  const slow = take(1, "moving", "slow");
  await take(2, "moving", "fast");
  release();
  await slow;
  assert.equal(view.bitmap.text, "fast");
});

test("replaced images are released", async () => {
  await take(1, "moving", "first");
  const first = view.bitmap;
  await take(2, "moving", "second");
  assert.ok(first.isClosed && !view.bitmap.isClosed);
});

test("a patch is laid over the photo at its position, and dropped without one", async () => {
  await take(1, "moving", "patch", [5, 7]);
  assert.equal(view.shown, null);
  await view.setPhoto("photo");
  await take(1, "moving", "patch", [5, 7]);
  const draws = view.bitmap.context.of("drawImage").map(([image, x, y]) => [image.text, x, y]);
  assert.deepEqual(draws, [["photo", 0, 0], ["patch", 5, 7]]);
  assert.deepEqual([view.bitmap.width, view.bitmap.height], [40, 30]);
});

test("another scene starts without an image", async () => {
  await take(9, "final", "old");
  view.reset();
  assert.equal(await take(1, "moving", "new"), "new");
});

test("the overlay covers the image", async () => {
  await take(1, "final", "image");
  view.context.calls.length = 0;
  view.setOverlay({ text: "overlay", close() {} });
  assert.deepEqual(view.context.of("drawImage").map(([image]) => image.text), ["image", "overlay"]);
});

test("false colour depends on stops from middle grey", () => {
  const grey = (stops) => {
    // The sRGB code of the luminance, and a gain for the rest, because codes are coarse.
    const data = new Uint8ClampedArray([100, 100, 100, 255]);
    falseColour(data, (0.18 * 2 ** stops) / linear(100 / 255));
    return `rgb(${data.slice(0, 3).join(" ")})`;
  };
  const bands = [-6, -4, -2, -1, 0, 1, 2, 3].map(grey);
  assert.deepEqual(bands, LUMINANCE_LEGEND.map(([color]) => color));
  // Luminance weights green most (Rec. 709).
  const colors = [[255, 0, 0], [0, 255, 0], [0, 0, 255]].map((rgb) => {
    const data = new Uint8ClampedArray([...rgb, 255]);
    falseColour(data, 1);
    return LUMINANCE_LEGEND.findIndex(([color]) => color === `rgb(${data.slice(0, 3).join(" ")})`);
  });
  assert.deepEqual(colors, [4, 6, 3]);
});
