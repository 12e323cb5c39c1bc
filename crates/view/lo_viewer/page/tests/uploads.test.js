import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";

import { openFiles, uploadFiles } from "../uploads.js";
import { FakeElement, installDocument } from "./support/dom.js";

let uploaded;
let refusal;
let messages;

beforeEach(() => {
  const document = installDocument();
  [uploaded, refusal, messages] = [[], null, []];
  const list = new FakeElement();
  list.append = (message) => messages.push(message.children[0].textContent);
  document.byId.messages = list;
  mock.timers.reset();
  mock.timers.enable({ apis: ["setTimeout"] });
  globalThis.fetch = async (address, { headers }) => {
    uploaded.push([address, decodeURIComponent(headers["X-File-Name"])]);
    return { ok: refusal === null, text: async () => refusal };
  };
  FakeElement.prototype.remove = () => {};
});

/** A file with the beginning of its content. */
const file = (name, head = "", size = 1) => ({ name, size, slice: () => new Blob([head]) });
let chosen;
const drop = (files, { isOpen = true, mayLeave = true, pixel = null } = {}) => {
  chosen = null;
  const page = { isOpen: () => isOpen, mayLeave: async () => mayLeave, chooseRoles: (_, roles) => { chosen = roles; } };
  return uploadFiles(files.map((one) => (typeof one === "string" ? file(one) : one)), page, pixel);
};

test("a mesh is uploaded after the files that it references", async () => {
  await drop(["Böx.OBJ", "box.mtl", "wood.png"]);
  assert.deepEqual(uploaded, [["upload/part", "box.mtl"], ["upload/part", "wood.png"], ["upload/mesh", "Böx.OBJ"]]);
});

test("meshes dropped on the photo get its position", async () => {
  await drop(["a.glb", "b.glb"], { pixel: [12.5, 30] });
  assert.deepEqual(uploaded, [["upload/mesh?u=12.5&v=30", "a.glb"], ["upload/mesh?u=12.5&v=30", "b.glb"]]);
});

test("a scene or a photo replaces the scene, if the user agrees", async () => {
  await drop(["room.scene"]);
  await drop(["photo.JPEG"]);
  await drop(["photo.jpg"], { mayLeave: false });
  assert.deepEqual(uploaded, [["upload/scene", "room.scene"], ["upload/photo", "photo.JPEG"]]);
});

test("a photo is uploaded after its depth and panorama", async () => {
  const hdr = file("room.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 512 +X 1024\n");
  await drop([hdr, "photo.jpg", "depth.npy"], { isOpen: false });
  assert.deepEqual(uploaded, [["upload/depth", "depth.npy"], ["upload/panorama", "room.hdr"], ["upload/photo", "photo.jpg"]]);
});

test("uncertain roles are asked", async () => {
  await drop(["a.jpg", "b.jpg"]);
  assert.deepEqual([chosen, uploaded], [["photo", "photo"], []]);
  await openFiles([file("a.jpg"), file("b.jpg")], ["panorama", "photo"]);
  assert.deepEqual(uploaded, [["upload/panorama", "a.jpg"], ["upload/photo", "b.jpg"]]);
});

test("files that cannot be used are refused with a reason", async () => {
  await drop(["box.glb"], { isOpen: false });
  await drop(["depth.npy"]);
  await drop(["notes.txt"]);
  await drop([file("big.glb", "", 2 ** 29)]);
  assert.deepEqual(uploaded, []);
  const reasons = [/open a photo or a scene first/, /depth\.npy: drop depth together with its photo/, /notes\.txt: not a photo/, /big\.glb has 512 MB; at most 256 MB/];
  for (const reason of reasons) assert.ok(messages.some((text) => reason.test(text)), `${reason} in ${messages}`);
});

test("the program's refusal and a lost connection are shown", async () => {
  refusal = "the mesh has no triangles";
  await drop(["box.glb"]);
  globalThis.fetch = async () => { throw new TypeError("failed"); };
  await drop(["room.scene"]);
  assert.ok(messages.includes("the mesh has no triangles"));
  assert.ok(messages.includes("room.scene could not be uploaded: is the program still running?"), String(messages));
});
