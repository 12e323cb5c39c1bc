// The panels on the right, which fold. The browser remembers which are folded.

/** Key of the browser's storage. */
const KEY = "lightoctree-folded-panels";

/** Restores the panels, and stores changes. */
export function rememberPanels() {
  const panels = [...document.querySelectorAll("details.panel")].filter((panel) => panel instanceof HTMLDetailsElement);
  const folded = stored();
  for (const panel of panels) {
    if (folded.includes(panel.id)) panel.open = false;
    panel.addEventListener("toggle", () => store(panels.filter(({ open }) => !open).map(({ id }) => id)));
  }
}

/** @returns {string[]} */
function stored() {
  try {
    const ids = JSON.parse(localStorage.getItem(KEY) ?? "[]");
    return Array.isArray(ids) ? ids : [];
  } catch {
    // Storage may be forbidden.
    return [];
  }
}

/** @param {string[]} ids */
function store(ids) {
  try {
    localStorage.setItem(KEY, JSON.stringify(ids));
  } catch {
    // Then panels are open again after a reload.
  }
}
