// Saving the scene, and the question before a room with unsaved changes is left.

import { byId, showMessage } from "./dom.js";
import { download, messageOf } from "./uploads.js";

/** @import { Page } from "./store.js" */

/**
 * A file chosen by the user (File System Access), which can be written again without a question.
 *
 * @typedef {{ name: string, createWritable: () => Promise<{ write: (content: Blob) => Promise<void>, close: () => Promise<void> }> }} Handle
 */

/** Kinds of files in the browser's dialog. */
const TYPES = [{ description: "lightoctree scene", accept: { "application/octet-stream": [".scene"] } }];

/**
 * Listens to Save and its keys. Provides `page.mayLeave`.
 *
 * @param {Page} page
 */
export function saving(page) {
  /** @type {{ scene: number, handle: Handle } | null} */
  let chosen = null;
  let isSaving = false;

  /**
   * Asks for a file; null if the browser cannot, undefined if the user cancels.
   *
   * @param {string} suggestedName
   * @returns {Promise<Handle | null | undefined>}
   */
  const pick = async (suggestedName) => {
    const picker = /** @type {any} */ (globalThis).showSaveFilePicker;
    if (!picker) return null;
    try {
      return await picker({ suggestedName, types: TYPES });
    } catch (error) {
      if (error instanceof DOMException && error.name === "AbortError") return undefined;
      return null;
    }
  };

  /**
   * Saves the scene; at first, and for another file, where the user chooses. Returns whether it was saved.
   *
   * @param {{ isElsewhere?: boolean }} [options]
   */
  const save = async ({ isElsewhere = false } = {}) => {
    if (!page.scene || !page.view || isSaving) return false;
    isSaving = true;
    const { scene } = page.scene;
    const name = page.view.file.split(/[/\\]/).at(-1) || "room.scene";
    try {
      const known = chosen?.scene === scene && !isElsewhere ? chosen.handle : null;
      const handle = known ?? await pick(name);
      if (handle === undefined) return false;
      const answer = await fetch("download/room.scene");
      if (!answer.ok) throw new Error(await answer.text());
      const change = Number(answer.headers.get("x-change"));
      const content = await answer.blob();
      if (handle) {
        const file = await handle.createWritable();
        await file.write(content);
        await file.close();
        chosen = { scene, handle };
      } else download(name, content);
      const file = handle?.name ?? name;
      page.send({ type: "saved", change, file });
      showMessage(handle ? `saved as ${file}` : `${file} is in the browser's downloads`);
      return true;
    } catch (error) {
      showMessage(`the scene was not saved: ${messageOf(error)}`, true);
      return false;
    } finally {
      isSaving = false;
    }
  };

  byId("save").onclick = () => save();
  byId("save-as").onclick = () => save({ isElsewhere: true });
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "s") return;
    event.preventDefault();
    save({ isElsewhere: event.shiftKey });
  });

  const dialog = byId("leave");
  page.mayLeave = async () => {
    if (!page.view?.unsaved) return true;
    byId("leave-text").textContent = `${page.view.file} has changes that no file has.`
      + (page.autosaves ? " They stay under Recent rooms." : "");
    dialog.returnValue = "";
    dialog.showModal();
    await new Promise((resolve) => { dialog.addEventListener("close", resolve, { once: true }); });
    if (dialog.returnValue === "save") return save();
    return dialog.returnValue === "discard";
  };
}
