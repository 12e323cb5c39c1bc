// Images and canvases without pixels: what is drawn is recorded.

/** Records the calls of methods and the last value of properties. */
export class FakeContext {
  constructor(canvas) {
    this.canvas = canvas;
    this.calls = [];
    return new Proxy(this, {
      get: (target, name) => (name in target ? target[name] : (...args) => { target.calls.push([name, ...args]); }),
    });
  }

  /** Returns the arguments of all calls of a method. */
  of(method) {
    return this.calls.filter(([name]) => name === method).map(([, ...args]) => args);
  }
}

export class FakeCanvas {
  constructor(width, height) {
    [this.width, this.height] = [width, height];
    this.context = new FakeContext(this);
  }

  getContext() { return this.context; }
}

/** A decoded image; `text` is its file's content. */
export class FakeBitmap {
  constructor(text) {
    Object.assign(this, { text, width: 40, height: 30, isClosed: false });
  }

  close() { this.isClosed = true; }
}

/** Installs images and canvases. Files decode at once. */
export function installCanvas() {
  globalThis.ImageBitmap = FakeBitmap;
  globalThis.OffscreenCanvas = FakeCanvas;
  globalThis.createImageBitmap = async (blob) => new FakeBitmap(await blob.text());
  globalThis.devicePixelRatio = 1;
  globalThis.getComputedStyle = () => ({ fontSize: "16px" });
}
