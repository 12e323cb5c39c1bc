import * as THREE from "three";
import { LEVELS, Shadow } from "./shadow.js";
import { Probes } from "./probes.js";
import { floats, integers } from "./room.js";
import { medianCut } from "./median_cut.js";
import * as models from "./model.js";

const $ = (id) => document.getElementById(id);
const room = globalThis.lightoctreeRoom;
if (!room) {
  $("status").textContent = "The file room.js is missing: it belongs beside index.html";
  throw new Error("no room");
}

/**
 * What the object is and where: the pixel of the photo on whose surface it stands, its height in metres, its turn about
 * the vertical in degrees. NaN is to be chosen.
 */
const UNKNOWN = { object: "matte", x: NaN, y: NaN, height: NaN, turn: 0 };
const state = { ...UNKNOWN };

/** Takes over what the address says, within its limits. */
function readAddress() {
  Object.assign(state, UNKNOWN);
  const said = new URLSearchParams(location.hash.slice(1));
  if (models.names.includes(said.get("object"))) state.object = said.get("object");
  for (const name of ["x", "y", "height", "turn"]) {
    if (said.has(name)) state[name] = Number(said.get(name));
  }
  state.height = state.height > 0 ? limited(state.height) : NaN;
  state.turn = Number.isFinite(state.turn) ? ((((state.turn + 180) % 360) + 360) % 360) - 180 : 0;
}

/** A height within the slider's limits. */
const limited = (height) => Math.min(Math.max(height, 0.02), 3);

const up = new THREE.Vector3().fromArray(room.up);
const upright = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), up);
const probes = new Probes(room.probes);
const { width, height, fx, fy, cx, cy } = room.camera;

let renderer, camera, scene, shadow, surfaces, environment, pmrem, target, model, photo;
const raycaster = new THREE.Raycaster();

async function start() {
  renderer = new THREE.WebGLRenderer({ canvas: $("view"), antialias: true, preserveDrawingBuffer: true });
  camera = lens();
  photo = await new THREE.TextureLoader().loadAsync(room.photo);
  photo.colorSpace = THREE.SRGBColorSpace;
  photo.generateMipmaps = false;
  photo.minFilter = THREE.LinearFilter;
  scene = new THREE.Scene();
  scene.background = photo;
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(floats(room.mesh.positions), 3));
  geometry.setIndex(new THREE.BufferAttribute(integers(room.mesh.triangles), 1));
  geometry.computeVertexNormals();
  smooth(geometry);
  shadow = new Shadow(geometry, photo);
  surfaces = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial());
  scene.add(shadow.mesh);
  environment = new THREE.DataTexture(probes.panorama, probes.width, probes.height, THREE.RGBAFormat, THREE.FloatType);
  environment.mapping = THREE.EquirectangularReflectionMapping;
  environment.minFilter = environment.magFilter = THREE.LinearFilter;
  pmrem = new THREE.PMREMGenerator(renderer);
  readAddress();
  use(models.sphere(state.object));
  chooseStart();
  resize();
  new ResizeObserver(resize).observe($("frame"));
  addEventListener("hashchange", () => {
    readAddress();
    use(models.sphere(state.object));
    chooseStart();
    label();
    show();
  });
  listen();
  globalThis.page = { state, show, isReady: true };
}

/** The photo's lens, principal point included. */
function lens() {
  const camera = new THREE.PerspectiveCamera();
  const [near, far] = [0.05, 200];
  camera.projectionMatrix.set(
    (2 * fx) / width, 0, 1 - (2 * cx) / width, 0,
    0, (2 * fy) / height, (2 * cy) / height - 1, 0,
    0, 0, -(far + near) / (far - near), (-2 * far * near) / (far - near),
    0, 0, -1, 0,
  );
  camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
  return camera;
}

/** The direction of a pixel of the photo. */
const ray = (x, y) => new THREE.Vector3((x - cx) / fx, (cy - y) / fy, -1).normalize();

/** The surface at a pixel, or null. Its normal is that of its surroundings. */
function surfaceAt(x, y) {
  if (!(x >= 0 && y >= 0 && x <= width && y <= height)) return null;
  raycaster.set(new THREE.Vector3(), ray(x, y));
  const [hit] = raycaster.intersectObject(surfaces);
  return hit ? { point: hit.point, normal: hit.normal.normalize() } : null;
}

/** Averages the normals of neighbours: depth is noisy. */
function smooth(geometry) {
  const [index, normals] = [geometry.index.array, geometry.attributes.normal.array];
  for (let round = 0; round < 6; round++) {
    const sums = normals.slice();
    for (let corner = 0; corner < index.length; corner++) {
      const next = corner % 3 === 2 ? corner - 2 : corner + 1;
      const [a, b] = [3 * index[corner], 3 * index[next]];
      for (let axis = 0; axis < 3; axis++) {
        sums[a + axis] += normals[b + axis];
        sums[b + axis] += normals[a + axis];
      }
    }
    normals.set(sums);
    geometry.normalizeNormals();
  }
}

/** Chooses what the address does not say: a level place in the lower middle of the photo, and a size by its distance. */
function chooseStart() {
  if (!surfaceAt(state.x, state.y)) {
    const places = [];
    for (let row = 1; row < 12; row++) for (let column = 1; column < 16; column++) places.push([(width * column) / 16, (height * row) / 12]);
    const far = ([x, y]) => Math.hypot(x - 0.5 * width, y - 0.8 * height);
    places.sort((a, b) => far(a) - far(b));
    const found = places.map(([x, y]) => ({ x, y, hit: surfaceAt(x, y) })).filter(({ hit }) => hit);
    const { x, y } = found.find(({ hit }) => hit.normal.dot(up) > 0.9) ?? found[0];
    Object.assign(state, { x, y });
  }
  if (!(state.height > 0)) state.height = Math.min(Math.max(0.15 * surfaceAt(state.x, state.y).point.length(), 0.05), 0.6);
}

function use(next) {
  if (model) scene.remove(model);
  model = next;
  scene.add(model);
}

/** Puts the object on the surface of its pixel, lights it, and draws. Returns whether there is a surface. */
function show() {
  const hit = surfaceAt(state.x, state.y);
  if (!hit) $("status").textContent = "The photo shows no surface there";
  if (hit) {
    model.position.copy(hit.point);
    model.quaternion.copy(upright).multiply(new THREE.Quaternion().setFromAxisAngle(new THREE.Vector3(0, 1, 0), (state.turn * Math.PI) / 180));
    model.scale.setScalar(state.height);
    model.updateMatrixWorld(true);
    const box = new THREE.Box3().setFromObject(model, true);
    // On a wall the object touches it with its side.
    const slope = hit.normal.dot(up);
    if (slope < 0.5) {
      const out = hit.normal.clone().addScaledVector(up, -slope).normalize();
      model.position.addScaledVector(out, box.getBoundingSphere(new THREE.Sphere()).radius);
      model.position.addScaledVector(up, -state.height / 2);
      model.updateMatrixWorld(true);
      box.setFromObject(model, true);
    }
    const panorama = probes.at(box.getCenter(new THREE.Vector3()).toArray());
    environment.needsUpdate = true;
    target = pmrem.fromEquirectangular(environment, target);
    scene.environment = target.texture;
    shadow.update(renderer, model, medianCut(panorama, probes.width, probes.height, LEVELS));
  }
  draw();
  return Boolean(hit);
}

function draw() {
  renderer.getDrawingBufferSize(shadow.uniforms.size.value);
  renderer.render(scene, camera);
}

function resize() {
  const frame = $("frame").getBoundingClientRect();
  const scale = Math.min(frame.width / width, frame.height / height);
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  renderer.setSize(Math.round(width * scale), Math.round(height * scale));
  show();
}

let asked = false;
/** Shows the state at the next frame, and keeps it in the address. */
function change(values) {
  Object.assign(state, values);
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    show();
    const kept = new URLSearchParams({ ...state, x: state.x.toFixed(1), y: state.y.toFixed(1) });
    history.replaceState(null, "", `#${kept}`);
  });
}

function listen() {
  const canvas = $("view");
  const pixel = ({ clientX, clientY }) => {
    const box = canvas.getBoundingClientRect();
    return { x: ((clientX - box.left) / box.width) * width, y: ((clientY - box.top) / box.height) * height };
  };
  const moveTo = (x, y) => {
    if (surfaceAt(x, y)) change({ x, y });
  };
  let held = null;
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    const at = pixel(event);
    raycaster.set(new THREE.Vector3(), ray(at.x, at.y));
    const isOnModel = raycaster.intersectObject(model).length > 0;
    held = isOnModel ? { x: state.x - at.x, y: state.y - at.y } : { x: 0, y: 0 };
    canvas.setPointerCapture(event.pointerId);
    if (!isOnModel) change(at);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return;
    const at = pixel(event);
    moveTo(at.x + held.x, at.y + held.y);
  });
  for (const kind of ["pointerup", "pointercancel"]) canvas.addEventListener(kind, () => (held = null));
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    resizeObject(state.height * Math.exp(-0.001 * event.deltaY));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const step = event.shiftKey ? 40 : 8;
    const moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
    const move = moves[event.key];
    if (!move) return;
    event.preventDefault();
    moveTo(state.x + move[0], state.y + move[1]);
  });
  const resizeObject = (value) => {
    change({ height: limited(value) });
    label();
  };
  $("height").addEventListener("input", () => resizeObject(Number($("height").value)));
  $("turn").addEventListener("input", () => {
    change({ turn: Number($("turn").value) });
    label();
  });
  for (const name of models.names) {
    $(name).addEventListener("click", () => {
      use(models.sphere(name));
      change({ object: name });
      label();
    });
  }
  const open = async (file) => {
    try {
      const { group, height } = await models.read(file);
      use(group);
      // A size that is improbable for a thing in a room is another unit.
      resizeObject(height > 0.02 && height < 3 ? height : state.height);
      state.object = file.name;
      $("status").textContent = "";
      label();
    } catch (error) {
      $("status").textContent = `${file.name}: ${error.message}`;
    }
  };
  $("model").addEventListener("change", ({ target }) => target.files[0] && open(target.files[0]));
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    if (event.dataTransfer.files[0]) open(event.dataTransfer.files[0]);
  });
  label();
}

function label() {
  $("height").value = state.height;
  $("turn").value = state.turn;
  for (const name of models.names) $(name).setAttribute("aria-pressed", String(state.object === name));
  $("height-text").textContent = state.height < 1 ? `${Math.round(100 * state.height)} cm` : `${state.height.toFixed(2)} m`;
  $("turn-text").textContent = `${Math.round(state.turn)}°`;
}

start().catch((error) => {
  $("status").textContent = `The room cannot be shown: ${error.message}`;
});
