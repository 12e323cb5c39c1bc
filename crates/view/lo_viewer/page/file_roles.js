// What dropped files are: by their names and the beginnings of their contents.

/** @typedef {"scene" | "photo" | "depth" | "panorama" | "depth-model" | "depth-model-config" | "mesh" | "other"} Role */
/** @typedef {{ role: Role, size: [number, number] | null }} Kind Size in pixels, if it is known. */

export const MESHES = ["glb", "gltf", "obj", "ply", "stl"];
export const SCENES = ["scene", "safetensors"];
export const PHOTOS = ["jpg", "jpeg", "png", "webp", "tif", "tiff", "bmp", "gif", "pnm", "ppm", "pgm", "heic", "heif", "hif", "jxl", "hdr", "exr", "pfm"];

/** Bytes that tell what an image is. */
export const HEAD_BYTES = 1 << 16;

/** @param {string} name */
export const endingOf = (name) => name.toLowerCase().split(".").at(-1) ?? "";

/**
 * Returns what a file is, from its name and its first bytes. An image is a photo, depth if it has one channel of more
 * than 8 bits, or a panorama if it is a map of radiance twice as wide as high.
 *
 * @type {(name: string, head: Uint8Array) => Kind}
 */
export function kindOf(name, head) {
  const ending = endingOf(name);
  if (SCENES.includes(ending)) return { role: "scene", size: null };
  if (MESHES.includes(ending)) return { role: "mesh", size: null };
  if (ending === "onnx") return { role: "depth-model", size: null };
  if (ending === "toml") return { role: "depth-model-config", size: null };
  if (ending === "npy") return { role: "depth", size: null };
  if (!PHOTOS.includes(ending)) return { role: "other", size: null };
  const found = imageOf(ending, head);
  const isWide = found.size !== null && found.size[0] === 2 * found.size[1];
  if (found.isDepth) return { role: "depth", size: found.size };
  return { role: isWide && found.isRadiance ? "panorama" : "photo", size: found.size };
}

/**
 * Assigns roles to files that are opened together. Of several photos, one that is twice as wide as high is a panorama,
 * and one named after depth is depth. Returns the role of each, and whether they are certain: one photo, and at most
 * one of each other role.
 *
 * @param {{ name: string, kind: Kind }[]} files
 * @returns {{ roles: Role[], isSure: boolean }}
 */
export function assigned(files) {
  const roles = files.map(({ kind }) => kind.role);
  const count = (/** @type {Role} */ role) => roles.filter((other) => other === role).length;
  for (const [i, { name, kind }] of files.entries()) {
    if (roles[i] !== "photo" || count("photo") < 2) continue;
    if (kind.size && kind.size[0] === 2 * kind.size[1] && !count("panorama")) roles[i] = "panorama";
    else if (/depth|lidar/i.test(name) && !count("depth")) roles[i] = "depth";
  }
  const isSure = count("photo") === 1 && ["depth", "panorama", "depth-model", "depth-model-config", "other"]
    .every((role) => count(/** @type {Role} */ (role)) <= (role === "other" ? 0 : 1));
  return { roles, isSure };
}

/** @typedef {{ size: [number, number] | null, isDepth: boolean, isRadiance: boolean }} ImageKind */

/**
 * @param {string} ending
 * @param {Uint8Array} head
 * @returns {ImageKind}
 */
function imageOf(ending, head) {
  const bytes = new DataView(head.buffer, head.byteOffset, head.byteLength);
  const text = (/** @type {number} */ length) => String.fromCharCode(...head.subarray(0, length));
  try {
    if (ending === "png" && text(8).endsWith("PNG\r\n\x1a\n")) {
      // IHDR: width, height, bit depth, colour type; type 0 is grey.
      return { size: [bytes.getUint32(16), bytes.getUint32(20)], isDepth: bytes.getUint8(24) === 16 && bytes.getUint8(25) === 0, isRadiance: false };
    }
    if (ending === "pfm") {
      const [, kind, width, height] = /^(P[fF])\s+(\d+)\s+(\d+)/.exec(text(64)) ?? [];
      return { size: kind ? [Number(width), Number(height)] : null, isDepth: kind === "Pf", isRadiance: true };
    }
    if (["pgm", "pnm"].includes(ending)) {
      const [, kind, width, height, most] = /^(P[25])\s+(?:#.*\n)*(\d+)\s+(\d+)\s+(\d+)/.exec(text(256)) ?? [];
      return { size: kind ? [Number(width), Number(height)] : null, isDepth: Boolean(kind) && Number(most) > 255, isRadiance: false };
    }
    if (ending === "hdr") {
      const [, height, width] = /[-+]Y (\d+) [-+]X (\d+)/.exec(text(Math.min(head.length, 4096))) ?? [];
      return { size: width ? [Number(width), Number(height)] : null, isDepth: false, isRadiance: true };
    }
    if (ending === "exr") return exrOf(bytes);
    if (["tif", "tiff"].includes(ending)) return tiffOf(bytes);
    if (["jpg", "jpeg"].includes(ending)) return { size: jpegSize(bytes), isDepth: false, isRadiance: false };
  } catch {
    // Shorter than its format demands: the program says so.
  }
  return { size: null, isDepth: false, isRadiance: false };
}

/**
 * OpenEXR: attributes of the first header. One channel is depth.
 *
 * @param {DataView} bytes
 * @returns {ImageKind}
 */
function exrOf(bytes) {
  let at = 8;
  const word = () => {
    let text = "";
    for (let code = bytes.getUint8(at++); code; code = bytes.getUint8(at++)) text += String.fromCharCode(code);
    return text;
  };
  let channels = 0;
  /** @type {[number, number] | null} */
  let size = null;
  for (let name = word(); name; name = word()) {
    word();
    const length = bytes.getUint32(at, true);
    at += 4;
    const end = at + length;
    if (name === "channels") {
      // Each channel has a name, and 16 bytes.
      for (let channel = word(); channel; channel = word()) {
        channels += 1;
        at += 16;
      }
    }
    if (name === "dataWindow") {
      const [left, top, right, bottom] = [0, 4, 8, 12].map((offset) => bytes.getInt32(at + offset, true));
      size = [right - left + 1, bottom - top + 1];
    }
    at = end;
  }
  return { size, isDepth: channels === 1, isRadiance: true };
}

/**
 * TIFF: tags of the first directory. One sample of more than 8 bits is depth.
 *
 * @param {DataView} bytes
 * @returns {ImageKind}
 */
function tiffOf(bytes) {
  const isLittle = bytes.getUint16(0) === 0x4949;
  const first = bytes.getUint32(4, isLittle);
  /** @type {Record<number, number>} */
  const tags = {};
  for (let i = 0; i < bytes.getUint16(first, isLittle); i++) {
    const at = first + 2 + 12 * i;
    const isShort = bytes.getUint16(at + 2, isLittle) === 3;
    tags[bytes.getUint16(at, isLittle)] = isShort ? bytes.getUint16(at + 8, isLittle) : bytes.getUint32(at + 8, isLittle);
  }
  // 256 width, 257 height, 258 bits per sample, 277 samples per pixel.
  return { size: [tags[256], tags[257]], isDepth: (tags[277] ?? 1) === 1 && (tags[258] ?? 1) > 8, isRadiance: false };
}

/**
 * JPEG: the size in the frame header.
 *
 * @param {DataView} bytes
 * @returns {[number, number] | null}
 */
function jpegSize(bytes) {
  for (let at = 2; at + 9 < bytes.byteLength;) {
    const marker = bytes.getUint8(at + 1);
    // SOF0 to SOF15, without DHT, JPG and DAC.
    if (marker >= 0xc0 && marker <= 0xcf && ![0xc4, 0xc8, 0xcc].includes(marker)) return [bytes.getUint16(at + 7), bytes.getUint16(at + 5)];
    at += 2 + bytes.getUint16(at + 2);
  }
  return null;
}
