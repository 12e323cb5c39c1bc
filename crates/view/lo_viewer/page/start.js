// The start page: the drop zone, the roles of chosen files, sample rooms and recent rooms.

import { byId, element, showMessage } from "./dom.js";
import { PHOTOS, SCENES } from "./file_roles.js";
import { messageOf, openFiles, uploadFiles } from "./uploads.js";

/** @import { Role } from "./file_roles.js" */
/** @import { RecentRoom, SampleView } from "./protocol.d.ts" */
/** @import { Page } from "./store.js" */

/** @type {[Role, string][]} */
const ROLES = [
  ["photo", "the photo"],
  ["depth", "measured depth of the photo"],
  ["panorama", "panorama of the room"],
  ["depth-model", "depth network, ONNX"],
  ["depth-model-config", "settings of the depth network"],
  ["other", "not used"],
];

/**
 * Builds the page. Provides `page.chooseRoles`. Returns `show(isShown, error)`, `setSamples(samples, canEstimate)` and
 * `setRecent(rooms)`.
 *
 * @param {Page} page
 */
export function startPage(page) {
  const root = byId("open");
  const picker = byId("open-files");
  const endings = [...SCENES, ...PHOTOS, "npy", "onnx", "toml"];
  picker.accept = endings.map((ending) => `.${ending}`).join(",");
  picker.onchange = () => {
    const files = [...(picker.files ?? [])];
    picker.value = "";
    if (files.length) uploadFiles(files, page);
  };

  /** @type {{ files: File[], selects: HTMLSelectElement[] } | null} */
  let choice = null;
  page.chooseRoles = (files, roles) => {
    const selects = files.map((file, i) => {
      const options = ROLES.map(([value, text]) => element("option", { value, textContent: text }));
      const select = element("select", { "aria-label": `What ${file.name} is` }, ...options);
      select.value = ROLES.some(([role]) => role === roles[i]) ? roles[i] : "other";
      return select;
    });
    choice = { files, selects };
    const rows = files.map((file, i) => element("div", { className: "row" }, element("span", { className: "name", textContent: file.name }), selects[i]));
    byId("open-roles").replaceChildren(...rows);
    show(true);
    byId("open-choice").hidden = false;
  };
  root.onsubmit = async (event) => {
    event.preventDefault();
    if (!choice) return;
    const { files, selects } = choice;
    const roles = selects.map((select) => ROLES.find(([role]) => role === select.value)?.[0] ?? "other");
    if (roles.filter((role) => role === "photo").length !== 1) return showMessage("choose one file as the photo", true);
    if (!await page.mayLeave()) return undefined;
    try {
      await openFiles(files, roles);
    } catch (error) {
      showMessage(messageOf(error), true);
    }
    return undefined;
  };

  /**
   * Asks the program to open or remove a room.
   *
   * @type {(path: string, method: string) => Promise<void>}
   */
  const ask = async (path, method) => {
    try {
      const answer = await fetch(path, { method });
      if (!answer.ok) throw new Error(await answer.text());
    } catch (error) {
      showMessage(messageOf(error), true);
    }
  };
  /** @type {(path: string) => () => Promise<void>} */
  const opens = (path) => async () => {
    if (await page.mayLeave()) await ask(path, "POST");
  };
  /** @type {(image: string, title: string, note: string, action: () => void) => HTMLElement} */
  const card = (image, title, note, action) => element("button", { type: "button", className: "card", onclick: action },
    element("img", { src: image, alt: "" }), element("strong", { textContent: title }), element("span", { textContent: note }));

  /** @type {(isShown: boolean, error?: string) => void} */
  const show = (isShown, error = "") => {
    root.hidden = !isShown;
    choice = null;
    byId("open-choice").hidden = true;
    byId("open-error").textContent = error;
    byId("open-back").hidden = !page.isOpen();
    if (isShown) picker.focus();
  };
  byId("open-back").onclick = () => show(false);
  byId("open-button").onclick = () => show(true);
  document.addEventListener("keydown", (event) => {
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "o") {
      event.preventDefault();
      show(true);
    } else if (event.key === "Escape" && !root.hidden && page.isOpen() && !document.querySelector("dialog[open]")) {
      event.stopPropagation();
      show(false);
      byId("stage").focus();
    }
  }, true);

  return {
    show,
    /** @type {(samples: SampleView[], canEstimate: boolean) => void} */
    setSamples(samples, canEstimate) {
      byId("open-text").hidden = !canEstimate;
      byId("open-scene-text").hidden = canEstimate;
      byId("samples").hidden = !samples.length;
      byId("sample-cards").replaceChildren(...samples.map(({ title, file }, i) => card(`sample/${i}`, title, file, opens(`sample/${i}`))));
    },
    /** @param {RecentRoom[]} rooms */
    setRecent(rooms) {
      byId("recent").hidden = !rooms.length;
      const now_s = Date.now() / 1000;
      byId("recent-cards").replaceChildren(...rooms.map((room) => {
        const path = `recent/${room.id}`;
        const name = room.file.split(/[/\\]/).at(-1) ?? room.file;
        const remove = element("button", { type: "button", className: "remove", textContent: "×", "aria-label": `Remove ${name} from the recent rooms` });
        remove.onclick = () => ask(path, "DELETE");
        // The picture of a room changes with it.
        const made = card(`${path}?${room.changed_s}`, name, noteOf(room, now_s), opens(path));
        return element("div", { className: "recent" }, made, remove);
      }));
    },
  };
}

/**
 * Describes a recent room.
 *
 * @type {(room: Pick<RecentRoom, "objects" | "unsaved" | "changed_s">, now_s: number) => string}
 */
export function noteOf({ objects, unsaved, changed_s }, now_s) {
  const parts = [agoOf(Math.max(now_s - changed_s, 0))];
  if (objects) parts.push(objects === 1 ? "1 object" : `${objects} objects`);
  if (unsaved) parts.push("not saved");
  return parts.join(", ");
}

/**
 * Describes a duration in words.
 *
 * @type {(seconds: number) => string}
 */
function agoOf(seconds) {
  if (seconds < 90) return "just now";
  if (seconds < 90 * 60) return `${Math.round(seconds / 60)} min ago`;
  if (seconds < 36 * 3600) return `${Math.round(seconds / 3600)} h ago`;
  return `${Math.round(seconds / 86400)} days ago`;
}
