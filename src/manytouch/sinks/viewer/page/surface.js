// The 3-D surface: x to the right, y (down in the image) to the front, depth upwards, all in the sensor's unit.
// Seen from the finger's side everything is turned half around y, so that a press is a dent.

import { CSS2DRenderer, OrbitControls, THREE } from "./three.js";
import { styled, table } from "./colours.js";
import { Axes, depthScale } from "./axes.js";
import { NARROW_PX, overlaps, separate } from "./label_places.js";

const VERTEX = `
  attribute float value; attribute float known;
  varying float vValue; varying float vKnown; varying vec3 vPlace;
  void main() {
    vValue = value; vKnown = known; vPlace = position;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }`;
const FRAGMENT = `
  uniform sampler2D map; uniform float low; uniform float high; uniform float contour; uniform float pitch; uniform float hatching; uniform vec3 blank;
  varying float vValue; varying float vKnown; varying vec3 vPlace;
  vec3 mark_of(vec3 ground) { return dot(ground, vec3(0.3, 0.59, 0.11)) > 0.45 ? vec3(0.0) : vec3(1.0); }
  float line(float at, float width) { float w = fwidth(at); return 1.0 - smoothstep(0.0, width * w, abs(fract(at - 0.5) - 0.5)); }
  void main() {
    float share = clamp((vValue - low) / (high - low), 0.0, 1.0);
    vec3 colour = texture2D(map, vec2(share * 0.996 + 0.002, 0.5)).rgb;
    float iso = line(vValue / contour, 1.3) * step(0.5 * contour, abs(vValue));
    float grid = max(line(vPlace.x / pitch, 1.1), line(vPlace.z / pitch, 1.1));
    vec3 mark = mark_of(colour);
    colour = mix(colour, mark, 0.10 * grid);
    colour = mix(colour, mark, 0.28 * iso);
    float hatch = step(0.6, fract((gl_FragCoord.x + gl_FragCoord.y) / hatching));
    colour = mix(mix(blank, mark_of(blank), 0.35 * hatch), colour, step(0.99, vKnown));
    gl_FragColor = vec4(colour, 1.0); // unlit: the same value has the same colour everywhere
  }`;

/** Whether WebGL is computed by the processor, where smooth edges would take most of the time. */
function isSoftware() {
  const context = document.createElement("canvas").getContext("webgl2");
  const info = context?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? context.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

/** Room at the left for the colours and the numbers of the depth axis; in a narrow pane the colours are above the surface. */
const LEFT_PX = 156, ABOVE_PX = 92;
const TALLEST = 0.16; // of the reach of the sheet: height above it that the view has room for

export class SurfacePane {
  constructor(stage) {
    Object.assign(this, { stage, stretch: 6, side: 1, isDirty: true, depth: null, x: [], y: [], overlays: [] });
    THREE.ColorManagement.enabled = false; // colours are those of the style sheet
    this.renderer = new THREE.WebGLRenderer({ antialias: !isSoftware(), alpha: true, powerPreference: "low-power" });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio || 1, 2));
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    stage.append(this.renderer.domElement);
    this.labels = new CSS2DRenderer();
    this.labels.domElement.className = "labels";
    stage.append(this.labels.domElement);
    this.scene = new THREE.Scene();
    this.sheet = new THREE.Group();
    this.scene.add(this.sheet);
    this.camera = new THREE.PerspectiveCamera(32, 1, 1, 5000);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.maxPolarAngle = 0.52 * Math.PI;
    this.controls.addEventListener("start", () => { this.isMoved = true; });
    this.controls.addEventListener("change", () => { this.isDirty = true; });
    this.material = new THREE.ShaderMaterial({
      vertexShader: VERTEX, fragmentShader: FRAGMENT, side: THREE.DoubleSide,
      uniforms: { map: { value: null }, low: { value: 0 }, high: { value: 1 }, contour: { value: 0.5 }, pitch: { value: 10 }, hatching: { value: 8 * Math.min(devicePixelRatio || 1, 2) }, blank: { value: new THREE.Color() } },
    });
    this.setMap("cividis");
    this.axes = new Axes(this.sheet);
    this.ray = new THREE.Raycaster();
    new ResizeObserver(() => (this.isMoved || !this.mesh ? this.resize() : this.home())).observe(stage);
  }

  /** Take a sensor's grid. */
  build({ x_mm, y_mm, unit }) {
    const isSame = this.mesh && this.x.length === x_mm.length && this.y.length === y_mm.length && this.x.every((x, i) => x === x_mm[i]);
    if (isSame) return;
    Object.assign(this, { x: x_mm, y: y_mm, unit });
    const nx = x_mm.length, ny = y_mm.length, count = nx * ny;
    const geometry = new THREE.BufferGeometry();
    this.position = new Float32Array(3 * count);
    this.value = new Float32Array(count); this.known = new Float32Array(count).fill(1);
    for (let j = 0; j < ny; j++) for (let i = 0; i < nx; i++) {
      const at = 3 * (j * nx + i);
      this.position[at] = x_mm[i]; this.position[at + 2] = y_mm[j];
    }
    for (const [name, array, size] of [["position", this.position, 3], ["value", this.value, 1], ["known", this.known, 1]]) {
      geometry.setAttribute(name, new THREE.BufferAttribute(array, size).setUsage(THREE.DynamicDrawUsage));
    }
    const index = new Uint32Array(6 * (nx - 1) * (ny - 1));
    for (let j = 0, at = 0; j < ny - 1; j++) for (let i = 0; i < nx - 1; i++) {
      const a = j * nx + i, c = a + nx;
      index.set([a, c, a + 1, a + 1, c, c + 1], at); at += 6;
    }
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
    const reach = Math.hypot(x_mm[nx - 1] - x_mm[0], y_mm[ny - 1] - y_mm[0]);
    geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3((x_mm[0] + x_mm[nx - 1]) / 2, 0, (y_mm[0] + y_mm[ny - 1]) / 2), 2 * reach);
    if (this.mesh) { this.sheet.remove(this.mesh); this.mesh.geometry.dispose(); }
    this.mesh = new THREE.Mesh(geometry, this.material);
    this.mesh.frustumCulled = false;
    this.sheet.add(this.mesh);
    this.reach = reach;
    this.material.uniforms.pitch.value = this.axes.build(x_mm, y_mm, unit) / 2;
    this.home();
  }

  /** Show a new frame: `depth` gives the shape, `value` the colour, from `low` to `high` with lines every `contour`. Hatched where `support` is 0. */
  update(depth, value, low, high, contour, support) {
    const nx = this.x.length, ny = this.y.length, { position, known } = this;
    if (!this.mesh || depth.length !== nx * ny) return;
    this.depth = depth;
    for (let at = 0; at < depth.length; at++) {
      const isKnown = depth[at] === depth[at] && value[at] === value[at];
      known[at] = isKnown && (!support || support[at]) ? 1 : 0;
      this.value[at] = isKnown ? value[at] : 0;
      position[3 * at + 1] = depth[at] === depth[at] ? depth[at] * this.stretch : 0;
    }
    Object.values(this.mesh.geometry.attributes).forEach((attribute) => { attribute.needsUpdate = true; });
    const { uniforms } = this.material;
    uniforms.low.value = low; uniforms.high.value = high; uniforms.contour.value = contour;
    this.deepest = Math.max(0.9, 0.995 * (this.deepest ?? 0));
    for (let at = 0; at < depth.length; at++) if (depth[at] > this.deepest) this.deepest = depth[at];
    this.isDirty = true;
  }

  setMap(name) {
    const map = new THREE.DataTexture(table(name), 256, 1, THREE.RGBAFormat);
    map.minFilter = map.magFilter = THREE.LinearFilter; map.needsUpdate = true;
    this.material?.uniforms.map.value?.dispose();
    this.material.uniforms.map.value = map;
    this.isDirty = true;
  }

  recolour() {
    this.material.uniforms.blank.value.set(styled("--line"));
    this.axes.recolour();
    this.isDirty = true;
  }

  setSide(side) {
    this.side = side;
    this.sheet.rotation.z = side > 0 ? 0 : Math.PI;
    this.isDirty = true;
  }

  home() {
    if (!this.mesh) return;
    this.isMoved = false;
    const [x, z] = this.middle();
    this.camera.near = 0.02 * this.reach; this.camera.far = 20 * this.reach;
    this.resize();
    this.controls.target.set(x * this.side, 0, z);
    const towards = new THREE.Vector3(-0.12, 0.84, 0.72).normalize();
    let far = 2 * this.reach;
    for (let round = 0; round < 4; round++) {
      this.camera.position.copy(this.controls.target).addScaledVector(towards, far);
      this.controls.update();
      far *= this.extent();
    }
    this.camera.position.copy(this.controls.target).addScaledVector(towards, far);
    this.controls.update();
    this.isDirty = true;
  }

  /** How much of the pane the sheet and what stands on it take, 1 when they just fill it. */
  extent() {
    this.scene.updateMatrixWorld(); this.camera.updateMatrixWorld();
    const [x0, x1, y0, y1] = [this.x[0], this.x[this.x.length - 1], this.y[0], this.y[this.y.length - 1]];
    const { clientWidth: width, clientHeight: height } = this.stage, isNarrow = width < NARROW_PX;
    const left = isNarrow ? 0.86 : Math.min(1 - (2 * LEFT_PX) / width, 0.86), above = isNarrow ? Math.min(1 - (2 * ABOVE_PX) / height, 0.84) : 0.84;
    let most = 0;
    for (const x of [x0, x1]) for (const y of [y0, y1]) for (const up of [0, TALLEST * this.reach]) {
      const seen = this.sheet.localToWorld(new THREE.Vector3(x, up, y)).project(this.camera);
      most = Math.max(most, seen.x / 0.86, -seen.x / left, seen.y / above, -seen.y / 0.74);
    }
    return most;
  }

  middle() {
    return [(this.x[0] + this.x[this.x.length - 1]) / 2, (this.y[0] + this.y[this.y.length - 1]) / 2];
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.stage;
    if (!width || !height) return;
    this.camera.aspect = width / height;
    const [right, down] = width < NARROW_PX ? [0, 24] : [40, 0]; // away from the colours
    this.camera.setViewOffset(width, height, -right, -down, width, height);
    this.camera.updateProjectionMatrix();
    this.renderer.setSize(width, height);
    this.labels.setSize(width, height);
    this.isDirty = true;
  }

  /** Depth at a place between the grid's points; 0 where not known. */
  depthAt(x, y) {
    if (!this.depth) return 0;
    const nx = this.x.length, ny = this.y.length;
    const u = Math.min(Math.max((x - this.x[0]) / (this.x[nx - 1] - this.x[0]), 0), 1) * (nx - 1);
    const v = Math.min(Math.max((y - this.y[0]) / (this.y[ny - 1] - this.y[0]), 0), 1) * (ny - 1);
    const i = Math.min(Math.floor(u), nx - 2), j = Math.min(Math.floor(v), ny - 2), a = u - i, b = v - j;
    const d = this.depth, at = j * nx + i;
    const found = (1 - b) * ((1 - a) * d[at] + a * d[at + 1]) + b * ((1 - a) * d[at + nx] + a * d[at + nx + 1]);
    return Number.isNaN(found) ? 0 : found;
  }

  /** Where a sheet's point is drawn. */
  place(x, y, above = 0) {
    return new THREE.Vector3(x, this.depthAt(x, y) * this.stretch + above, y);
  }

  /** The undeformed x, y under a mouse event, or null. */
  pick(event) {
    if (!this.mesh) return null;
    const box = this.renderer.domElement.getBoundingClientRect();
    const at = new THREE.Vector2(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
    this.ray.setFromCamera(at, this.camera);
    const hit = this.ray.intersectObject(this.mesh, false)[0];
    if (!hit) return null;
    const local = this.sheet.worldToLocal(hit.point.clone());
    return [local.x, local.z];
  }

  /** Where a sheet's point is on the screen, in the page's pixels. */
  onScreen(x, y) {
    this.scene.updateMatrixWorld(); this.camera.updateMatrixWorld();
    const seen = this.sheet.localToWorld(this.place(x, y)).project(this.camera);
    const box = this.renderer.domElement.getBoundingClientRect();
    return [box.left + ((seen.x + 1) / 2) * box.width, box.top + ((1 - seen.y) / 2) * box.height];
  }

  /** Fit the depth axis to its length on the screen; there is none behind the sheet, nor where the colours or the tools are. */
  fitDepthAxis() {
    if (!this.depth) return;
    this.scene.updateMatrixWorld(); this.camera.updateMatrixWorld();
    const { clientWidth: width, clientHeight: height } = this.stage;
    const seen = (up) => { const at = this.sheet.localToWorld(new THREE.Vector3(this.x[0], up, this.y[0])).project(this.camera); return [((at.x + 1) / 2) * width, ((1 - at.y) / 2) * height]; };
    const tallest = TALLEST * this.reach, [x0, y0] = seen(0), [x1, y1] = seen(tallest);
    const { top, step } = depthScale(this.deepest, (Math.hypot(x1 - x0, y1 - y0) * this.stretch) / tallest, tallest / this.stretch);
    const [x, y] = seen(top * this.stretch), box = this.stage.getBoundingClientRect();
    const axis = [Math.min(x, x0) - 36, Math.min(y, y0) - 20, Math.abs(x - x0) + 40, Math.abs(y - y0) + 20];
    const isCovered = [...this.stage.querySelectorAll(".scale, .press-tools")].map((element) => element.getBoundingClientRect())
      .some((other) => overlaps(axis, [other.left - box.left, other.top - box.top, other.width, other.height]));
    this.axes.setHeight(isCovered || this.side < 0 ? 0 : top, step, this.stretch);
  }

  render() {
    if (!this.isDirty) return false;
    this.isDirty = false;
    this.fitDepthAxis();
    this.renderer.render(this.scene, this.camera);
    this.labels.render(this.scene, this.camera);
    const of = (name) => [...this.labels.domElement.getElementsByClassName(name)];
    separate(this.stage, of("tag"), of("axis"), [...this.stage.querySelectorAll(".scale, .press-tools, .view-tools, .hint")]);
    return true;
  }
}
