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

/** Reads a glTF binary; the model is scaled to height 1, and stands on the origin. */
export async function read(file) {
  const { scene } = await new GLTFLoader().parseAsync(await file.arrayBuffer(), "");
  const box = new THREE.Box3().setFromObject(scene, true);
  const size = box.getSize(new THREE.Vector3());
  if (!(size.length() > 0)) throw new Error(`${file.name}: the file has no visible triangles`);
  const centre = box.getCenter(new THREE.Vector3());
  // Flat things are scaled by their width.
  const height = size.y > 0.02 * size.length() ? size.y : size.length();
  scene.position.set(-centre.x, -box.min.y, -centre.z);
  const group = new THREE.Group().add(new THREE.Group().add(scene));
  group.children[0].scale.setScalar(1 / height);
  return { group, height };
}
