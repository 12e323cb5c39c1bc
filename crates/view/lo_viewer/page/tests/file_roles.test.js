import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { assigned, kindOf } from "../file_roles.js";

const ASSETS = new URL("../../../../../apps/lightoctree-cli/assets/", import.meta.url);
const real = (name) => kindOf(name, readFileSync(new URL(name, ASSETS)));
/** Joins texts and numbers (32-bit, little-endian) to bytes. */
const bytes = (...parts) => new Uint8Array(Buffer.concat(parts.map((part) => {
  if (typeof part === "string") return Buffer.from(part, "latin1");
  const word = Buffer.alloc(4);
  word.writeInt32LE(part);
  return word;
})));

/** The header of an OpenEXR file. */
const exr = (channels, [width, height]) => {
  const list = `${channels.map((name) => `${name}\0${"\0".repeat(16)}`).join("")}\0`;
  return bytes(0x01312f76, 2, "channels\0chlist\0", list.length, list, "dataWindow\0box2i\0", 16, 0, 0, width - 1, height - 1, "\0");
};

test("real photos and depth are told apart by their contents", () => {
  assert.deepEqual(real("library_color.jpg"), { role: "photo", size: [1920, 1440] });
  assert.deepEqual(real("library_lidar_depth.png"), { role: "depth", size: [256, 192] });
  assert.deepEqual(real("office_desk_depth.png"), { role: "depth", size: [640, 480] });
  assert.deepEqual(real("table.jpg"), { role: "photo", size: [1600, 1067] });
});

test("radiance twice as wide as high is a panorama, one channel is depth", () => {
  assert.deepEqual(kindOf("a.exr", exr(["B", "G", "R"], [1024, 512])), { role: "panorama", size: [1024, 512] });
  assert.equal(kindOf("a.exr", exr(["B", "G", "R"], [1024, 768])).role, "photo");
  assert.equal(kindOf("a.exr", exr(["Z"], [1024, 512])).role, "depth");
  assert.equal(kindOf("a.pfm", bytes("Pf\n640 480\n-1.0\n")).role, "depth");
  assert.equal(kindOf("a.pfm", bytes("PF\n640 320\n-1.0\n")).role, "panorama");
  assert.equal(kindOf("a.pgm", bytes("P5\n# made by a sensor\n640 480\n65535\n")).role, "depth");
  assert.equal(kindOf("a.pgm", bytes("P5 640 480 255\n")).role, "photo");
  assert.equal(kindOf("a.hdr", bytes("#?RADIANCE\n\n-Y 512 +X 1024\n")).role, "panorama");
});

test("TIFF files of one wide sample are depth", () => {
  const tiff = (bits, samples) => {
    const tag = (id, value) => String.fromCharCode(id & 255, id >> 8, 3, 0, 1, 0, 0, 0, value & 255, value >> 8, 0, 0);
    return bytes("II*\0", 8, "\x04\0", tag(256, 64), tag(257, 48), tag(258, bits), tag(277, samples));
  };
  assert.deepEqual(kindOf("a.tif", tiff(32, 1)), { role: "depth", size: [64, 48] });
  assert.equal(kindOf("a.tiff", tiff(8, 1)).role, "photo");
  assert.equal(kindOf("a.tif", tiff(16, 3)).role, "photo");
});

test("names decide where contents do not, and cut files are no error", () => {
  const role = (name) => kindOf(name, new Uint8Array(3)).role;
  const roles = ["room.scene", "a.GLB", "net.onnx", "net.toml", "depth.npy", "photo.PNG", "a.exr", "a.tif", "a.jpg", "notes.txt"].map(role);
  assert.deepEqual(roles, ["scene", "mesh", "depth-model", "depth-model-config", "depth", "photo", "photo", "photo", "photo", "other"]);
});

test("roles are certain with one photo and at most one file of each other kind", () => {
  const of = (...files) => assigned(files.map(([name, role, size = null]) => ({ name, kind: { role, size } })));
  assert.deepEqual(of(["a.jpg", "photo"], ["d.png", "depth"]), { roles: ["photo", "depth"], isSure: true });
  assert.deepEqual(of(["a.jpg", "photo"], ["b.jpg", "photo", [2000, 1000]]), { roles: ["photo", "panorama"], isSure: true });
  assert.deepEqual(of(["a.jpg", "photo"], ["a_depth.png", "photo"]), { roles: ["photo", "depth"], isSure: true });
  assert.equal(of(["a.jpg", "photo"], ["b.jpg", "photo"]).isSure, false);
  assert.equal(of(["a.jpg", "photo"], ["b.txt", "other"]).isSure, false);
  assert.equal(of(["a.exr", "depth"], ["b.exr", "depth"], ["a.jpg", "photo"]).isSure, false);
  // A single wide photo stays one.
  assert.deepEqual(of(["b.jpg", "photo", [2000, 1000]]), { roles: ["photo"], isSure: true });
});
