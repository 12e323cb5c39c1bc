// State shared by the parts of the page, and the actions that they provide to one another.

/**
 * @typedef {object} Page
 *
 * State:
 * @property {object | null} scene The open scene, `SceneInfo` in `protocol.rs`.
 * @property {object | null} view The session, `SessionView` in `lo_session`.
 * @property {number} change Number of the last change; images refer to it.
 * @property {object[]} materials Material presets.
 * @property {number | null} selectedId Id of the selected object.
 * @property {object | null} hovered The object under the pointer.
 * @property {((pixel: number[] | null) => void) | null} picking Receives the next clicked pixel, or null if picking is
 *   cancelled; null unless a pixel is being picked.
 * @property {number} exposure Exposure of the display, stops.
 *
 * Derived state:
 * @property {() => object | null} selected Returns the selected object.
 * @property {() => boolean} isOpen Returns whether a scene is open.
 * @property {() => boolean} mayLeave Asks for confirmation if closing the scene would discard objects.
 *
 * Actions, from `main.js`:
 * @property {(message: object) => void} send Sends a message to the program, `FromPage` in `protocol.rs`.
 * @property {(command: object) => void} preview Previews a command, at most once per display frame.
 * @property {(time_s: number) => void} seek Moves to another time.
 * @property {(id: number | null) => void} select Selects an object.
 * @property {(event: MouseEvent) => number[]} photoPosition Returns the photo position of a pointer event.
 * @property {() => number} reach Returns the radius in which a handle is hit, photo pixels.
 * @property {(pixel: number[]) => void} hover Moves the probe to a photo position.
 * @property {() => void} redraw Redraws handles and overlay lines in the next display frame.
 * @property {Record<string, () => void>} keys Actions by key.
 *
 * Actions, from other parts:
 * @property {() => object | null} gesture Returns the current gesture on the photo (`gestures.js`).
 * @property {() => void} pickFile Opens the file picker for meshes (`uploads.js`).
 */

/** @type {Page} */
export const page = {
  scene: null,
  view: null,
  change: 0,
  materials: [],
  selectedId: null,
  hovered: null,
  picking: null,
  exposure: 0,

  selected: () => page.view?.objects.find((object) => object.id === page.selectedId) ?? null,
  isOpen: () => page.scene !== null,
  mayLeave: () => !page.view?.objects.length || confirm("The objects in this photo will be lost. Open another one?"),

  send() {},
  preview() {},
  seek() {},
  select() {},
  photoPosition: () => [0, 0],
  reach: () => 0,
  hover() {},
  redraw() {},
  keys: {},

  gesture: () => null,
  pickFile() {},
};
// A field that is missing above is an error.
Object.seal(page);

/**
 * Measurements of movements, for tests: latencies and display times of the last drafts, send times of previews, and the
 * shown frame.
 */
export const figures = { latencies_ms: [], frames_at_ms: [], sent: new Map(), shown: null };
