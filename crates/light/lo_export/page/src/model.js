import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

/** The materials of the built-in sphere; matte is as that of `lightoctree insert`. */
const MATERIALS = {
  matte: { color: new THREE.Color(0.8, 0.8, 0.8), roughness: 0.9, metalness: 0 },
  chrome: { color: new THREE.Color(0.95, 0.95, 0.95), roughness: 0, metalness: 1 },
};

export const names = Object.keys(MATERIALS);

/** A sphere of height 1 that stands on the origin. */
export function sphere(name) {
  const mesh = new THREE.Mesh(new THREE.SphereGeometry(0.5, 96, 64), new THREE.MeshStandardMaterial(MATERIALS[name]));
  mesh.position.y = 0.5;
  return new THREE.Group().add(mesh);
}

/** Extensions that three.js reads without further decoders. Others may be absent from a model, but not required. */
const READ = [
  "KHR_lights_punctual", "KHR_materials_anisotropy", "KHR_materials_clearcoat", "KHR_materials_dispersion",
  "KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_iridescence", "KHR_materials_sheen",
  "KHR_materials_specular", "KHR_materials_transmission", "KHR_materials_unlit", "KHR_materials_volume",
  "KHR_mesh_quantization", "KHR_texture_transform", "EXT_materials_bump", "EXT_mesh_gpu_instancing",
  "EXT_texture_avif", "EXT_texture_webp",
];

/** Refuses files that are no whole glTF binary, and those that need an unknown extension. */
export function check(bytes) {
  const view = new DataView(bytes);
  if (bytes.byteLength < 20 || view.getUint32(0, true) !== 0x46546c67) throw new Error("this is no glTF binary (.glb)");
  if (view.getUint32(8, true) > bytes.byteLength) throw new Error("the file is cut off");
  const text = new TextDecoder().decode(new Uint8Array(bytes, 20, view.getUint32(12, true)));
  const unknown = (JSON.parse(text).extensionsRequired ?? []).filter((name) => !READ.includes(name));
  if (unknown.length) throw new Error(`the model needs ${unknown.join(", ")}; save it without compression`);
}

/** Reads a glTF binary; the model is scaled to height 1, and stands on the origin. */
export async function read(file) {
  const bytes = await file.arrayBuffer();
  check(bytes);
  const { scene } = await new GLTFLoader().parseAsync(bytes, "");
  const [lights, solid] = [[], []];
  scene?.traverse((thing) => {
    if (thing.isLight) lights.push(thing);
    if (thing.isMesh) solid.push(thing);
  });
  if (!solid.length) throw new Error("the model has no triangles");
  // The room lights it.
  lights.forEach((light) => light.removeFromParent());
  const box = new THREE.Box3().setFromObject(scene, true);
  const size = box.getSize(new THREE.Vector3());
  if (!(size.length() > 0)) throw new Error("the model has no size");
  const centre = box.getCenter(new THREE.Vector3());
  // Flat things are scaled by their width.
  const height = size.y > 0.02 * size.length() ? size.y : size.length();
  scene.position.set(-centre.x, -box.min.y, -centre.z);
  const group = new THREE.Group().add(new THREE.Group().add(scene));
  group.children[0].scale.setScalar(1 / height);
  return { group, height };
}
