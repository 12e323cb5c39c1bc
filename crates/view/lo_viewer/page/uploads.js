// Uploads and downloads: dropped or chosen meshes with their files, scenes and photos; saved files.

import { around, byId, element, showMessage } from "./dom.js";
import { HEAD_BYTES, MESHES, assigned, kindOf } from "./file_roles.js";

/** @import { Pixel } from "./camera.js" */
/** @import { Role } from "./file_roles.js" */
/** @import { Page } from "./store.js" */

/** Upload limit of the program, bytes. */
const MAX_BYTES = 256 * 2 ** 20;

/** Maximum number of files of a dropped folder. */
const MAX_FILES = 300;

/** @param {unknown} error */
export const messageOf = (error) => (error instanceof Error ? error.message : String(error));

/**
 * Uploads a file.
 *
 * @param {string} kind
 * @param {File} file
 */
async function upload(kind, file) {
  if (file.size > MAX_BYTES) throw new Error(`${file.name} has ${Math.round(file.size / 2 ** 20)} MB; at most ${MAX_BYTES / 2 ** 20} MB are accepted`);
  let answer;
  try {
    answer = await fetch(`upload/${kind}`, { method: "POST", body: file, headers: { "X-File-Name": encodeURIComponent(file.name) } });
  } catch {
    throw new Error(`${file.name} could not be uploaded: is the program still running?`);
  }
  if (!answer.ok) throw new Error(await answer.text());
}

/**
 * Uploads files of known roles: a scene, or a photo after the files that belong to it.
 *
 * @param {File[]} files
 * @param {Role[]} roles
 */
export async function openFiles(files, roles) {
  /** @param {Role} role */
  const of = (role) => files.filter((_, i) => roles[i] === role);
  const [main] = [...of("scene"), ...of("photo")];
  if (!main) throw new Error("none of these files is a photo of the room");
  const isScene = roles[files.indexOf(main)] === "scene";
  for (const role of /** @type {const} */ (["depth", "depth-model", "depth-model-config", "panorama"])) {
    if (isScene) break;
    for (const file of of(role)) await upload(role, file);
  }
  await upload(isScene ? "scene" : "photo", main);
}

/**
 * Uploads dropped or chosen files: meshes with their files into the open room, at a photo position if one is given; or
 * a scene, or a photo with depth and panorama. Files whose roles are uncertain are handed to `page.chooseRoles`.
 *
 * @param {File[]} files
 * @param {Pick<Page, "isOpen" | "mayLeave" | "chooseRoles">} page
 * @param {Pixel | null} [pixel]
 */
export async function uploadFiles(files, page, pixel = null) {
  try {
    const kinds = await Promise.all(files.map(async (file) => kindOf(file.name, new Uint8Array(await file.slice(0, HEAD_BYTES).arrayBuffer()))));
    const meshes = files.filter((_, i) => kinds[i].role === "mesh");
    if (meshes.length && page.isOpen()) {
      for (const part of files.filter((file) => !meshes.includes(file))) await upload("part", part);
      const place = pixel ? `?u=${pixel[0]}&v=${pixel[1]}` : "";
      for (const mesh of meshes) {
        const hide = showMessage(`reading ${mesh.name} …`);
        await upload(`mesh${place}`, mesh).finally(hide);
      }
      return;
    }
    const scene = kinds.findIndex(({ role }) => role === "scene");
    if (scene < 0 && meshes.length) throw new Error("open a photo or a scene first, then drop the mesh");
    const { roles, isSure } = assigned(files.map(({ name }, i) => ({ name, kind: kinds[i] })));
    if (scene < 0 && !roles.includes("photo") && !roles.includes("panorama")) {
      const names = files.map((file) => file.name).join(", ");
      if (roles.includes("depth")) throw new Error(`${names}: drop depth together with its photo`);
      throw new Error(`${names}: not a photo, a scene or a mesh (GLB, glTF, OBJ, PLY, STL)`);
    }
    // A panorama alone is opened as a photo, and the program says what is wrong with it.
    if (files.length === 1 && roles[0] === "panorama") roles[0] = "photo";
    else if (scene < 0 && !isSure) {
      page.chooseRoles(files, roles);
      return;
    }
    if (await page.mayLeave()) await openFiles(files, roles);
  } catch (error) {
    showMessage(messageOf(error), true);
  }
}

/**
 * Returns the files of a drop, those in dropped folders included.
 *
 * @param {DataTransfer} data
 * @returns {Promise<File[]>}
 */
async function filesOf(data) {
  const entries = [...data.items].map((item) => item.webkitGetAsEntry?.() ?? null);
  if (!entries.some((entry) => entry?.isDirectory)) return [...data.files];
  /** @type {File[]} */
  const files = [];
  /** @param {FileSystemEntry | null} entry */
  const collect = async (entry) => {
    if (!entry || files.length >= MAX_FILES) return;
    if (entry instanceof FileSystemFileEntry) files.push(await new Promise((resolve, reject) => { entry.file(resolve, reject); }));
    if (!(entry instanceof FileSystemDirectoryEntry)) return;
    const reader = entry.createReader();
    // A reader returns its entries in portions.
    for (;;) {
      /** @type {FileSystemEntry[]} */
      const portion = await new Promise((resolve, reject) => { reader.readEntries(resolve, reject); });
      if (!portion.length) return;
      for (const child of portion) await collect(child);
    }
  };
  for (const entry of entries) await collect(entry);
  return files;
}

/**
 * Listens for dropped files and objects. Provides `page.pickFile`.
 *
 * @param {Page} page
 */
export function listenForFiles(page) {
  const hint = byId("drop-hint");
  const zone = byId("drop-zone");
  /** @param {DragEvent} event */
  const hasFiles = (event) => event.dataTransfer?.types.includes("Files") ?? false;
  /** @param {DragEvent} event */
  const isOnStart = (event) => around(event, "#open") !== null;
  /** @type {(isOver: boolean) => void} */
  const answer = (isOver) => {
    hint.hidden = !isOver || !byId("open").hidden;
    zone.classList.toggle("over", isOver);
  };
  document.addEventListener("dragover", (event) => {
    event.preventDefault();
    answer(hasFiles(event));
  });
  document.addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) answer(false);
  });
  document.addEventListener("drop", async (event) => {
    event.preventDefault();
    answer(false);
    const pixel = isOnStart(event) ? null : pixelAt(page, event);
    if (page.dragged) {
      if (pixel) page.send({ type: "command", command: { do: "add", ...page.dragged, pixel } });
      page.dragged = null;
      return;
    }
    const files = event.dataTransfer ? await filesOf(event.dataTransfer) : [];
    if (files.length) uploadFiles(files, page, pixel);
  });

  const picker = element("input", { type: "file", multiple: true, accept: [...MESHES, "mtl", "bin", "png", "jpg", "jpeg"].map((ending) => `.${ending}`).join(",") });
  picker.onchange = () => {
    uploadFiles([...(picker.files ?? [])], page);
    picker.value = "";
  };
  page.pickFile = () => picker.click();
}

/**
 * Returns the photo position of a drop on the photo, or null.
 *
 * @param {Page} page
 * @param {MouseEvent} event
 * @returns {Pixel | null}
 */
function pixelAt(page, event) {
  if (!page.scene || byId("stage").dataset.view === "room" || !around(event, "#stage")) return null;
  const pixel = page.photoPosition(event);
  const { width, height } = page.scene.camera;
  return pixel[0] >= 0 && pixel[1] >= 0 && pixel[0] < width && pixel[1] < height ? pixel : null;
}

/**
 * Downloads a file of the program through the browser.
 *
 * @param {string} file
 * @param {string} query
 */
export async function save(file, query) {
  try {
    const answer = await fetch(`download/${file}${query}`);
    if (!answer.ok) throw new Error(await answer.text());
    download(file, await answer.blob());
  } catch (error) {
    showMessage(messageOf(error), true);
  }
}

/**
 * Hands a file to the browser's downloads.
 *
 * @type {(name: string, content: Blob) => void}
 */
export function download(name, content) {
  const address = URL.createObjectURL(content);
  element("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}
