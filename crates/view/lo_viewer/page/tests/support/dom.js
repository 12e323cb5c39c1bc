// A document for modules that build controls or listen to events: elements with properties, attributes and events.

/** An element; `closest` only matches what a test names in `matches`. */
export class FakeElement extends EventTarget {
  constructor(tag = "div") {
    super();
    Object.assign(this, {
      tag, id: "", type: "", value: "", min: "", max: "", step: "", textContent: "", className: "", title: "",
      hidden: false, disabled: false, checked: false, style: {}, dataset: {}, attributes: {}, children: [], matches: [],
    });
    this.box = { left: 0, top: 0, width: 100, height: 100 };
  }

  get valueAsNumber() { return this.value === "" ? NaN : Number(this.value); }
  get firstChild() { return this.children[0] ?? null; }
  append(...children) { this.children.push(...children); }
  setAttribute(name, value) { this.attributes[name] = value; }
  getAttribute(name) { return this.attributes[name] ?? null; }
  getBoundingClientRect() { return this.box; }
  closest(selectors) { return this.matches.includes(selectors) ? this : null; }
  focus() { document.activeElement = this; }
  setPointerCapture() {}

  /** Dispatches an event with properties. Returns it. */
  fire(type, properties = {}) {
    const event = Object.assign(new Event(type, { cancelable: true }), properties);
    this.dispatchEvent(event);
    return event;
  }
}

/** Installs a document. `byId` holds its elements; missing ones are created. */
export function installDocument() {
  const byId = {};
  globalThis.Element = globalThis.HTMLElement = FakeElement;
  globalThis.document = Object.assign(new FakeElement("document"), {
    byId,
    activeElement: null,
    createElement: (tag) => new FakeElement(tag),
    getElementById: (id) => (byId[id] ??= new FakeElement()),
    querySelectorAll: () => [],
  });
  return globalThis.document;
}
