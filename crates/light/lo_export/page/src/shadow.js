/**
 * The photo's surfaces with the shadow of the object: the photo is multiplied by the light that the object lets through,
 * divided by all light (differential rendering). The light is that of `medianCut`; each of its lights has a shadow map, a
 * tile of one texture.
 */
import * as THREE from "three";

export const LEVELS = 5;
const LIGHTS = 2 ** LEVELS;
const COLUMNS = 8;
const TILE = 128;
/** The surfaces hide the object a little later than they are measured, as share of their distance. */
const BEHIND = 0.012;

const DEPTH_VERTEX = `
  uniform vec3 centre, towards;
  varying float height;
  void main() {
    vec4 at = modelMatrix * vec4(position, 1.0);
    height = dot(at.xyz - centre, towards);
    gl_Position = projectionMatrix * viewMatrix * at;
  }`;
const DEPTH_FRAGMENT = `
  varying float height;
  void main() { gl_FragColor = vec4(height, 0.0, 0.0, 1.0); }`;

const SURFACE_VERTEX = `
  varying vec3 at, facing;
  void main() {
    at = position;
    facing = normal;
    gl_Position = projectionMatrix * viewMatrix * vec4(position * ${(1 + BEHIND).toFixed(4)}, 1.0);
  }`;
const SURFACE_FRAGMENT = `
  #define LIGHTS ${LIGHTS}
  #define TAPS 6
  uniform sampler2D photo, heights;
  uniform vec2 size;
  uniform vec3 centre;
  uniform float extent;
  uniform int count;
  uniform vec3 directions[LIGHTS], across[LIGHTS], fluxes[LIGHTS];
  uniform float radii[LIGHTS];
  varying vec3 at, facing;

  float noise(vec2 pixel) { return fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715)))); }

  float visible(int light, vec3 from) {
    vec3 towards = directions[light], right = across[light], up = cross(towards, right);
    float height = dot(from, towards);
    float spread = tan(min(radii[light], 1.2)) * max(-height, 0.0);
    vec2 place = vec2(dot(from, right), dot(from, up));
    if (height > extent || length(place) > extent + spread) return 1.0;
    float lit = 0.0, turn = 6.2831853 * noise(gl_FragCoord.xy);
    vec2 tile = vec2(light % ${COLUMNS}, light / ${COLUMNS});
    for (int tap = 0; tap < TAPS; tap++) {
      float angle = turn + 2.3999632 * float(tap), far = sqrt((float(tap) + 0.5) / float(TAPS)) * spread;
      vec2 uv = 0.5 + 0.5 * (place + far * vec2(cos(angle), sin(angle))) / extent;
      bool inside = all(greaterThan(uv, vec2(0.01))) && all(lessThan(uv, vec2(0.99)));
      float above = texture2D(heights, (tile + clamp(uv, 0.01, 0.99)) / vec2(${COLUMNS}.0, ${LIGHTS / COLUMNS}.0)).r;
      lit += inside && above > height + 0.02 * extent ? 0.0 : 1.0;
    }
    return lit / float(TAPS);
  }

  void main() {
    vec3 all = vec3(0.0), through = vec3(0.0), normal = normalize(facing);
    for (int light = 0; light < count; light++) {
      vec3 flux = fluxes[light] * max(dot(normal, directions[light]), 0.0);
      all += flux;
      if (flux.g > 0.0) through += flux * visible(light, at - centre);
    }
    vec3 share = (through + 1e-6) / (all + 1e-6);
    // Far away the few samples are noise.
    share = mix(share, vec3(1.0), smoothstep(5.0, 9.0, distance(at, centre) / extent));
    gl_FragColor = vec4(texture2D(photo, gl_FragCoord.xy / size).rgb * share, 1.0);
    #include <colorspace_fragment>
  }`;

const vectors = () => Array.from({ length: LIGHTS }, () => new THREE.Vector3());

export class Shadow {
  /** @param {THREE.BufferGeometry} geometry the photo's surfaces, in the camera's frame */
  constructor(geometry, photo) {
    this.heights = new THREE.WebGLRenderTarget(COLUMNS * TILE, (LIGHTS / COLUMNS) * TILE, {
      type: THREE.HalfFloatType,
      minFilter: THREE.NearestFilter,
      magFilter: THREE.NearestFilter,
      generateMipmaps: false,
    });
    this.uniforms = {
      photo: { value: photo },
      heights: { value: this.heights.texture },
      size: { value: new THREE.Vector2(1, 1) },
      centre: { value: new THREE.Vector3() },
      extent: { value: 1 },
      count: { value: 0 },
      directions: { value: vectors() },
      across: { value: vectors() },
      fluxes: { value: vectors() },
      radii: { value: new Array(LIGHTS).fill(0) },
    };
    this.mesh = new THREE.Mesh(
      geometry,
      new THREE.ShaderMaterial({ uniforms: this.uniforms, vertexShader: SURFACE_VERTEX, fragmentShader: SURFACE_FRAGMENT }),
    );
    this.mesh.frustumCulled = false;
    this.depth = new THREE.ShaderMaterial({
      uniforms: { centre: this.uniforms.centre, towards: { value: new THREE.Vector3() } },
      vertexShader: DEPTH_VERTEX,
      fragmentShader: DEPTH_FRAGMENT,
      side: THREE.DoubleSide,
    });
    this.camera = new THREE.OrthographicCamera();
    this.scene = new THREE.Scene();
    this.scene.overrideMaterial = this.depth;
  }

  /** Renders the shadow maps of an object under these lights. */
  update(renderer, model, lights) {
    const box = new THREE.Box3().setFromObject(model, true);
    const sphere = box.getBoundingSphere(new THREE.Sphere());
    const { uniforms, camera } = this;
    const extent = Math.max(1.02 * sphere.radius, 1e-3);
    uniforms.centre.value.copy(sphere.center);
    uniforms.extent.value = extent;
    uniforms.count.value = lights.length;
    [camera.left, camera.right, camera.bottom, camera.top] = [-extent, extent, -extent, extent];
    [camera.near, camera.far] = [0, 4 * extent];
    camera.updateProjectionMatrix();
    const parent = model.parent;
    this.scene.add(model);
    // Light passes through glass.
    const clear = [];
    model.traverse((thing) => {
      const materials = [thing.material ?? []].flat();
      const isClear = ({ transmission, transparent, opacity }) => transmission > 0.5 || (transparent && opacity < 0.5);
      if (thing.isMesh && thing.visible && materials.length && materials.every(isClear)) clear.push(thing);
    });
    for (const thing of clear) thing.visible = false;
    const colour = renderer.getClearColor(new THREE.Color());
    const alpha = renderer.getClearAlpha();
    renderer.setRenderTarget(this.heights);
    // Below everything: no occluder.
    renderer.setClearColor(new THREE.Color(-2 * extent, 0, 0), 1);
    this.heights.scissorTest = true;
    lights.forEach(({ direction, radius, flux }, index) => {
      const towards = uniforms.directions.value[index].fromArray(direction);
      const helper = Math.abs(towards.y) < 0.9 ? new THREE.Vector3(0, 1, 0) : new THREE.Vector3(1, 0, 0);
      const across = uniforms.across.value[index].crossVectors(helper, towards).normalize();
      uniforms.fluxes.value[index].fromArray(flux);
      uniforms.radii.value[index] = radius;
      const up = new THREE.Vector3().crossVectors(towards, across);
      camera.matrix.makeBasis(across, up, towards).setPosition(sphere.center.clone().addScaledVector(towards, 2 * extent));
      camera.matrix.decompose(camera.position, camera.quaternion, camera.scale);
      this.depth.uniforms.towards.value.copy(towards);
      const [x, y] = [TILE * (index % COLUMNS), TILE * Math.floor(index / COLUMNS)];
      this.heights.viewport.set(x, y, TILE, TILE);
      this.heights.scissor.set(x, y, TILE, TILE);
      renderer.setRenderTarget(this.heights);
      renderer.render(this.scene, camera);
    });
    renderer.setRenderTarget(null);
    renderer.setClearColor(colour, alpha);
    for (const thing of clear) thing.visible = true;
    parent.add(model);
  }
}
