// Files that the user drops or picks: meshes with what they name, scenes, photos.

import { byId, element, say } from "./dom.js";

/** As the program takes them. */
const MAX_BYTES = 256 * 2 ** 20;

const MESHES = ["glb", "gltf", "obj", "ply", "stl"];
const SCENES = ["scene", "safetensors"];
const PHOTOS = ["jpg", "jpeg", "png", "webp", "tif", "tiff", "bmp", "hdr", "exr", "pfm"];

const endingOf = (file) => file.name.split(".").pop().toLowerCase();

async function upload(kind, file) {
  if (file.size > MAX_BYTES) throw new Error(`${file.name} has ${Math.round(file.size / 2 ** 20)} MB; at most ${MAX_BYTES / 2 ** 20} MB are taken`);
  let answer;
  try {
    answer = await fetch(`upload/${kind}`, { method: "POST", body: file, headers: { "X-File-Name": encodeURIComponent(file.name) } });
  } catch {
    throw new Error(`${file.name} could not be sent: is the program still running?`);
  }
  if (!answer.ok) throw new Error(await answer.text());
}

/** Takes what was dropped: a scene, a mesh with its files, or a photo. */
export async function take(files, page) {
  try {
    const of = (endings) => files.filter((file) => endings.includes(endingOf(file)));
    const [scene] = of(SCENES);
    const meshes = of(MESHES);
    if (scene) return page.mayLeave() && await upload("scene", scene);
    if (meshes.length && page.isOpen()) {
      for (const part of files.filter((file) => !meshes.includes(file))) await upload("part", part);
      for (const mesh of meshes) {
        const unsay = say(`reading ${mesh.name} …`);
        await upload("mesh", mesh).finally(unsay);
      }
      return undefined;
    }
    if (meshes.length) throw new Error("open a photo or a scene first, then drop the mesh into it");
    const photos = of(PHOTOS);
    if (photos.length === 1) return page.mayLeave() && await upload("photo", photos[0]);
    if (photos.length > 1) throw new Error("which one is the photo? Use the fields for photo, depth and panorama");
    throw new Error(`${files.map((file) => file.name).join(", ")}: neither a photo nor a scene nor a mesh (GLB, glTF, OBJ, PLY, STL)`);
  } catch (error) {
    say(error.message, true);
    return undefined;
  }
}

/** Listens for drops and for the form of what to open. `page.isOpen()` and `page.mayLeave()` say what is there. */
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
    const files = [...event.dataTransfer.files];
    if (files.length) take(files, page);
  });

  const picker = element("input", { type: "file", multiple: true, accept: [...MESHES, "mtl", "bin", "png", "jpg", "jpeg"].map((ending) => `.${ending}`).join(",") });
  picker.onchange = () => {
    take([...picker.files], page);
    picker.value = "";
  };
  page.pickFile = () => picker.click();

  byId("open").onsubmit = async (event) => {
    event.preventDefault();
    const [main] = byId("open-main").files;
    if (!main) return say("choose a photo or a scene file", true);
    try {
      if (SCENES.includes(endingOf(main))) return await upload("scene", main);
      for (const kind of ["depth", "depth-model", "panorama"]) {
        for (const file of byId(`open-${kind}`).files) {
          await upload(endingOf(file) === "toml" ? "depth-model-config" : kind, file);
        }
      }
      return await upload("photo", main);
    } catch (error) {
      return say(error.message, true);
    }
  };
}

/** Fetches a file that the program makes, and lets the browser save it. */
export async function save(file, query) {
  try {
    const answer = await fetch(`download/${file}${query}`);
    if (!answer.ok) throw new Error(await answer.text());
    const address = URL.createObjectURL(await answer.blob());
    element("a", { href: address, download: file }).click();
    setTimeout(() => URL.revokeObjectURL(address), 10000);
  } catch (error) {
    say(error.message, true);
  }
}
