// Uploads and downloads: dropped or chosen meshes with their files, scenes and photos; saved files.

import { byId, element, showMessage } from "./dom.js";

/** @import { Page } from "./store.js" */

/** Upload limit of the program, bytes. */
const MAX_BYTES = 256 * 2 ** 20;

const MESHES = ["glb", "gltf", "obj", "ply", "stl"];
const SCENES = ["scene", "safetensors"];
const PHOTOS = ["jpg", "jpeg", "png", "webp", "tif", "tiff", "bmp", "gif", "pnm", "ppm", "pgm", "heic", "heif", "hif", "jxl", "hdr", "exr", "pfm"];

/** @param {File} file */
const endingOf = (file) => file.name.toLowerCase().split(".").at(-1) ?? "";

/** @param {unknown} error */
const messageOf = (error) => (error instanceof Error ? error.message : String(error));

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
 * Uploads dropped files: a scene, meshes with their files, or a photo.
 *
 * @param {File[]} files
 * @param {Pick<Page, "isOpen" | "mayLeave">} page
 */
export async function uploadFiles(files, page) {
  try {
    /** @param {string[]} endings */
    const of = (endings) => files.filter((file) => endings.includes(endingOf(file)));
    const [scene] = of(SCENES);
    const meshes = of(MESHES);
    if (scene) return page.mayLeave() && await upload("scene", scene);
    if (meshes.length && page.isOpen()) {
      for (const part of files.filter((file) => !meshes.includes(file))) await upload("part", part);
      for (const mesh of meshes) {
        const hide = showMessage(`reading ${mesh.name} …`);
        await upload("mesh", mesh).finally(hide);
      }
      return undefined;
    }
    if (meshes.length) throw new Error("open a photo or a scene first, then drop the mesh");
    const photos = of(PHOTOS);
    if (photos.length === 1) return page.mayLeave() && await upload("photo", photos[0]);
    if (photos.length > 1) throw new Error("more than one photo: use the fields for photo, depth and panorama");
    throw new Error(`${files.map((file) => file.name).join(", ")}: not a photo, a scene or a mesh (GLB, glTF, OBJ, PLY, STL)`);
  } catch (error) {
    showMessage(messageOf(error), true);
    return undefined;
  }
}

/**
 * Listens for dropped files and the form to open a photo or scene. Provides `page.pickFile`.
 *
 * @param {Page} page
 */
export function listenForFiles(page) {
  const hint = byId("drop-hint");
  document.addEventListener("dragover", (event) => {
    event.preventDefault();
    hint.hidden = !page.isOpen();
  });
  document.addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) hint.hidden = true;
  });
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    hint.hidden = true;
    const files = [...(event.dataTransfer?.files ?? [])];
    if (files.length) uploadFiles(files, page);
  });

  const picker = element("input", { type: "file", multiple: true, accept: [...MESHES, "mtl", "bin", "png", "jpg", "jpeg"].map((ending) => `.${ending}`).join(",") });
  picker.onchange = () => {
    uploadFiles([...(picker.files ?? [])], page);
    picker.value = "";
  };
  page.pickFile = () => picker.click();

  byId("open").onsubmit = async (event) => {
    event.preventDefault();
    const [main] = byId("open-main").files ?? [];
    if (!main) return showMessage("choose a photo or a scene file first", true);
    try {
      if (SCENES.includes(endingOf(main))) return await upload("scene", main);
      for (const kind of /** @type {const} */ (["depth", "depth-model", "panorama"])) {
        for (const file of byId(`open-${kind}`).files ?? []) {
          await upload(endingOf(file) === "toml" ? "depth-model-config" : kind, file);
        }
      }
      return await upload("photo", main);
    } catch (error) {
      return showMessage(messageOf(error), true);
    }
  };
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
    const address = URL.createObjectURL(await answer.blob());
    element("a", { href: address, download: file }).click();
    setTimeout(() => URL.revokeObjectURL(address), 10000);
  } catch (error) {
    showMessage(messageOf(error), true);
  }
}
