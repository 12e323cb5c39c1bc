import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";

import { uploadFiles } from "../uploads.js";
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

const drop = (names, { isOpen = true, mayLeave = true } = {}) =>
  uploadFiles(names.map((name) => ({ name, size: 1 })), { isOpen: () => isOpen, mayLeave: () => mayLeave });

test("a mesh is uploaded after the files that it references", async () => {
  await drop(["Böx.OBJ", "box.mtl", "wood.png"]);
  assert.deepEqual(uploaded, [["upload/part", "box.mtl"], ["upload/part", "wood.png"], ["upload/mesh", "Böx.OBJ"]]);
});

test("a scene or a photo replaces the scene, if the user agrees", async () => {
  await drop(["room.scene"]);
  await drop(["photo.JPEG"]);
  await drop(["photo.jpg"], { mayLeave: false });
  assert.deepEqual(uploaded, [["upload/scene", "room.scene"], ["upload/photo", "photo.JPEG"]]);
});

test("files that cannot be used are refused with a reason", async () => {
  await drop(["box.glb"], { isOpen: false });
  await drop(["a.jpg", "b.jpg"]);
  await drop(["notes.txt"]);
  await uploadFiles([{ name: "big.glb", size: 2 ** 29 }], { isOpen: () => true, mayLeave: () => true });
  assert.deepEqual(uploaded, []);
  const reasons = [/open a photo or a scene first/, /more than one photo/, /notes\.txt: not a photo/, /big\.glb has 512 MB; at most 256 MB/];
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
