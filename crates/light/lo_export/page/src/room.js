/** The room, as `room.js` beside the page has it: numbers are little-endian in base64. */
import { DataUtils } from "three";

/** @returns {ArrayBuffer} */
function bytes(base64) {
  return Uint8Array.from(atob(base64), (character) => character.charCodeAt(0)).buffer;
}

export const floats = (base64) => new Float32Array(bytes(base64));
export const integers = (base64) => new Uint32Array(bytes(base64));
export const flags = (base64) => new Uint8Array(bytes(base64));
export const halves = (base64) => Float32Array.from(new Uint16Array(bytes(base64)), DataUtils.fromHalfFloat);
