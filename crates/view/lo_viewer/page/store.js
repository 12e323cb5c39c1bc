// State shared by the parts of the page, and the actions that they provide to one another.

import { NO_LIGHTS } from "./light_marks.js";

/** @import { Pixel } from "./camera.js" */
/** @import { Role } from "./file_roles.js" */
/** @import { Gesture } from "./gestures.js" */
/** @import { Gizmo, Rect } from "./handles.js" */
/** @import { PhotoLights } from "./light_marks.js" */
/** @import { Command, FromPage, ObjectMaterial, ObjectView, Preset, SceneInfo, SessionView, ToPage } from "./protocol.d.ts" */

/** @typedef {{ mesh: string, material?: ObjectMaterial }} NewObject */

/**
 * @typedef {object} Page
 *
 * State:
 * @property {SceneInfo | null} scene The open scene.
 * @property {SessionView | null} view The session.
 * @property {number} change Number of the last change; images refer to it.
 * @property {Preset[]} materials Material presets.
 * @property {number | null} selectedId Id of the selected object.
 * @property {number[]} alsoSelected Ids of further selected objects.
 * @property {string | null} selectedLight Id of the selected light; then no object is selected.
 * @property {ObjectView | null} hovered The object under the pointer.
 * @property {((pixel: Pixel | null) => void) | null} picking Receives the next clicked pixel, or null if picking is
 *   cancelled; null unless a pixel is being picked.
 * @property {number} exposure Exposure of the display, stops.
 * @property {NewObject | null} dragged Object that is dragged from the panel into the photo.
 * @property {boolean} autosaves Whether the program saves open rooms automatically.
 *
 * Derived state:
 * @property {() => SceneInfo} openScene Returns the open scene; an error if none is open.
 * @property {() => SessionView} openView Returns the session; an error if there is none.
 * @property {() => ObjectView | null} selected Returns the selected object.
 * @property {() => boolean} isOpen Returns whether a scene is open.
 *
 * Actions, from `main.js`:
 * @property {(message: FromPage) => void} send Sends a message to the program.
 * @property {(command: Command) => void} preview Previews a command, at most once per display frame.
 * @property {(time_s: number) => void} seek Moves to another time.
 * @property {(id: number | null, isAdding?: boolean) => void} select Selects an object, alone or besides others.
 * @property {(id: string | null) => void} selectLight Selects a light.
 * @property {(id: number) => boolean} isSelected Returns whether an object is selected.
 * @property {() => ObjectView[]} group Returns all selected objects.
 * @property {() => PhotoLights} photoLights Returns the lights on the photo.
 * @property {(text: string) => void} hint Shows what a drag does; "" for nothing.
 * @property {(event: MouseEvent) => Pixel} photoPosition Returns the photo position of a pointer event.
 * @property {() => number} reach Returns the radius in which a handle is hit, photo pixels.
 * @property {() => Rect} visible Returns the part of the photo on the stage.
 * @property {() => Gizmo | null} gizmo Returns the handles of the selected object; null if it is locked or hidden.
 * @property {(pixel: Pixel) => void} hover Moves the probe to a photo position.
 * @property {() => void} redraw Redraws handles and overlay lines in the next display frame.
 * @property {Record<string, () => void>} keys Actions by key.
 *
 * Actions, from other parts:
 * @property {() => Gesture | null} gesture Returns the current gesture on the photo (`gestures.js`).
 * @property {() => void} pickFile Opens the file picker for meshes (`uploads.js`).
 * @property {(files: File[], roles: Role[]) => void} chooseRoles Asks what files are (`start.js`).
 * @property {() => Promise<boolean>} mayLeave Asks to save unsaved changes. Returns whether the room may be left
 *   (`saving.js`).
 * @property {(event: PointerEvent) => void} startPan Starts to move the zoomed photo (`photo_stage.js`).
 * @property {(direction: number) => void} zoom Zooms the photo in (1), out (−1) or to the whole of it (0).
 */

/** @type {Page} */
export const page = {
  scene: null,
  view: null,
  change: 0,
  materials: [],
  selectedId: null,
  alsoSelected: [],
  selectedLight: null,
  hovered: null,
  picking: null,
  exposure: 0,
  dragged: null,
  autosaves: false,

  openScene() {
    if (!page.scene) throw new Error("no scene is open");
    return page.scene;
  },
  openView() {
    if (!page.view) throw new Error("there is no session");
    return page.view;
  },
  selected: () => page.view?.objects.find((object) => object.id === page.selectedId) ?? null,
  isOpen: () => page.scene !== null,

  send() {},
  preview() {},
  seek() {},
  select() {},
  selectLight() {},
  isSelected: () => false,
  group: () => [],
  photoLights: () => NO_LIGHTS,
  hint() {},
  photoPosition: () => [0, 0],
  reach: () => 0,
  visible: () => ({ left: 0, top: 0, right: 0, bottom: 0 }),
  gizmo: () => null,
  hover() {},
  redraw() {},
  keys: {},

  gesture: () => null,
  pickFile() {},
  chooseRoles() {},
  mayLeave: async () => true,
  startPan() {},
  zoom() {},
};
// A field that is missing above is an error.
Object.seal(page);

/** @typedef {Extract<ToPage, { type: "frame" }>} Frame */

/**
 * @typedef {object} Figures
 * @property {number[]} latencies_ms
 * @property {number[]} frames_at_ms
 * @property {Map<number, number>} sent
 * @property {Frame | null} shown
 */

/**
 * Measurements of movements, for tests: latencies and display times of the last drafts, send times of previews, and the
 * shown frame.
 *
 * @type {Figures}
 */
export const figures = { latencies_ms: [], frames_at_ms: [], sent: new Map(), shown: null };
