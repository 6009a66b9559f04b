// Marks on the surface: contacts with force arrow, uncertainty ellipse and label; contacts of the comparison; measured points.

import { CSS2DObject, THREE } from "./three.js";
import { contactColour, styled } from "./colours.js";
import { render } from "./elements.js";
import { force, isKnown, length, units, withStd } from "./numbers.js";

const AROUND = 48, ALONG = 61, STDS = 2;

/** Objects that are reused from frame to frame. */
class Pool {
  constructor(parent, make) { Object.assign(this, { parent, make, all: new Map() }); }

  use(keys, update) {
    const wanted = new Set(keys);
    for (const [key, mark] of this.all) if (!wanted.has(key)) { mark.remove(this.parent); this.all.delete(key); }
    keys.forEach((key, at) => {
      if (!this.all.has(key)) this.all.set(key, this.make(this.parent, key));
      update(this.all.get(key), at);
    });
  }
}

function ring(colour) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * AROUND), 3).setUsage(THREE.DynamicDrawUsage));
  const line = new THREE.LineLoop(geometry, new THREE.LineBasicMaterial({ color: colour, depthTest: false, transparent: true}));
  line.renderOrder = 5; line.frustumCulled = false;
  return line;
}

/** The nearest point of the sheet: what is estimated of a contact may reach beyond it. */
function onSheet({ x, y }, px, py) {
  return [Math.min(Math.max(px, x[0]), x.at(-1)), Math.min(Math.max(py, y[0]), y.at(-1))];
}

/** Project a ring onto the surface; `axes` are the columns of a 2 x 2 matrix that makes an ellipse of a circle. */
function drape(line, pane, x, y, axes) {
  const { array } = line.geometry.attributes.position;
  for (let i = 0; i < AROUND; i++) {
    const angle = (2 * Math.PI * i) / AROUND, c = Math.cos(angle), s = Math.sin(angle);
    const [px, py] = onSheet(pane, x + axes[0] * c + axes[1] * s, y + axes[2] * c + axes[3] * s);
    array[3 * i] = px; array[3 * i + 1] = pane.depthAt(px, py) * pane.stretch; array[3 * i + 2] = py;
  }
  line.geometry.attributes.position.needsUpdate = true;
}

function segments(colour) {
  const line = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: colour, depthTest: false, transparent: true }));
  line.renderOrder = 5; line.frustumCulled = false;
  return line;
}

/** Project closed polygons onto the surface; the buffer grows as needed. */
function drapePolygons(line, pane, polygons) {
  const { geometry } = line, count = 2 * polygons.reduce((sum, { length }) => sum + length, 0);
  if ((geometry.attributes.position?.count ?? 0) < count) {
    geometry.dispose();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(6 * count), 3).setUsage(THREE.DynamicDrawUsage));
  }
  geometry.setDrawRange(0, count);
  line.visible = count > 0;
  if (!count) return;
  const { array } = geometry.attributes.position;
  let at = 0;
  for (const polygon of polygons) polygon.forEach(([x, y], corner) => {
    const next = polygon[(corner + 1) % polygon.length];
    pane.place(...onSheet(pane, x, y)).toArray(array, at); pane.place(...onSheet(pane, ...next)).toArray(array, at + 3); at += 6;
  });
  geometry.attributes.position.needsUpdate = true;
}

/** Columns of the matrix of the ellipse under uniform pressure; null where it is not known. */
function pressureEllipse({ half_axes_mm: [major, minor], orientation_rad: angle }) {
  if (!isKnown(major) || !isKnown(minor) || !isKnown(angle)) return null;
  const c = Math.cos(angle), s = Math.sin(angle);
  return [major * c, -minor * s, major * s, minor * c];
}

/** Columns of the Cholesky factor of a covariance, times `STDS`. */
function ellipse([xx, xy, yy]) {
  if (!isKnown(xx) || xx <= 0) return null;
  const a = Math.sqrt(xx), b = xy / a, c = Math.sqrt(Math.max(yy - b * b, 0));
  return [STDS * a, 0, STDS * b, STDS * c];
}

class ContactMark {
  constructor(parent, id) {
    this.colour = contactColour(id);
    this.ring = ring("#ffffff"); this.inner = ring(this.colour);
    this.outline = segments(this.colour); this.ellipse = ring(this.colour);
    this.ellipse.material.opacity = 0.5;
    const material = new THREE.MeshBasicMaterial({ color: this.colour, depthTest: false, transparent: true });
    this.shaft = new THREE.Mesh(new THREE.CylinderGeometry(1, 1, 1, 12).translate(0, 0.5, 0), material);
    this.head = new THREE.Mesh(new THREE.ConeGeometry(1, 1, 18).translate(0, 0.5, 0), material);
    this.foot = new THREE.Mesh(new THREE.SphereGeometry(1, 16, 12), material);
    this.arrow = new THREE.Group().add(this.shaft, this.head);
    this.element = document.createElement("div");
    this.element.className = "tag";
    this.element.style.setProperty("--tag", this.colour);
    this.tag = new CSS2DObject(this.element);
    this.tag.center.set(0.5, 1.15);
    for (const mesh of [this.shaft, this.head, this.foot]) mesh.renderOrder = 6;
    this.parts = [this.outline, this.ellipse, this.ring, this.inner, this.arrow, this.foot, this.tag];
    parent.add(...this.parts);
  }

  update(pane, contact, label) {
    const reach = pane.reach, at = pane.place(contact.x_mm, contact.y_mm);
    const axes = ellipse(contact.centre_covariance_mm2);
    this.ring.visible = this.inner.visible = axes !== null;
    if (axes) { drape(this.inner, pane, contact.x_mm, contact.y_mm, axes); drape(this.ring, pane, contact.x_mm, contact.y_mm, axes.map((v) => 1.06 * v)); }
    drapePolygons(this.outline, pane, contact.outline_mm ?? []);
    const shape = pressureEllipse(contact);
    this.ellipse.visible = shape !== null;
    if (shape) drape(this.ellipse, pane, contact.x_mm, contact.y_mm, shape);
    const hasForce = isKnown(contact.force_N);
    const [sx, sy] = contact.shear_N.map((value) => (isKnown(value) ? value : 0));
    const vector = hasForce ? new THREE.Vector3(sx, contact.force_N, sy) : new THREE.Vector3(0, 1, 0);
    const size = hasForce ? Math.min(0.05 + 0.03 * vector.length(), 0.3) * reach : 0.07 * reach;
    const thick = 0.0035 * reach;
    this.arrow.position.copy(at);
    this.arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), vector.normalize());
    this.head.visible = hasForce;
    const cone = hasForce ? Math.min(0.035 * reach, 0.6 * size) : 0;
    this.shaft.scale.set(hasForce ? thick : 0.4 * thick, size - cone, hasForce ? thick : 0.4 * thick);
    this.head.scale.set(0.011 * reach, cone || 1, 0.011 * reach);
    this.head.position.y = size - cone;
    this.foot.position.copy(at); this.foot.scale.setScalar(0.006 * reach);
    this.tag.position.copy(at).addScaledVector(vector, size);
    render(this.element, label);
  }

  remove(parent) {
    parent.remove(...this.parts);
    for (const part of [this.outline, this.ellipse, this.ring, this.inner, this.shaft, this.head, this.foot]) part.geometry.dispose();
    for (const part of [this.outline, this.ellipse, this.ring, this.inner, this.shaft]) part.material.dispose();
  }
}

class ComparisonMark {
  constructor(parent) {
    this.ring = ring(styled("--text"));
    this.parent = parent;
    parent.add(this.ring);
  }

  update(pane, contact) {
    const radius = Math.sqrt((contact.area_mm2 ?? 0) / Math.PI) || 0.02 * pane.reach;
    this.ring.material.color.set(styled("--text"));
    drape(this.ring, pane, contact.x_mm, contact.y_mm, [radius, 0, 0, radius]);
  }

  remove(parent) { parent.remove(this.ring); this.ring.geometry.dispose(); this.ring.material.dispose(); }
}

class PointMark {
  constructor(parent, name) {
    this.name = name;
    this.ball = new THREE.Mesh(new THREE.SphereGeometry(1, 16, 12), new THREE.MeshBasicMaterial({ color: "#ffffff", depthTest: false, transparent: true }));
    this.rim = new THREE.Mesh(new THREE.SphereGeometry(1, 16, 12), new THREE.MeshBasicMaterial({ color: "#101820", depthTest: false, transparent: true }));
    this.rim.renderOrder = 7; this.ball.renderOrder = 8;
    this.element = document.createElement("div");
    this.element.className = "tag point";
    this.tag = new CSS2DObject(this.element);
    this.tag.center.set(0.5, -0.7);
    this.parts = [this.ball, this.rim, this.tag];
    parent.add(...this.parts);
  }

  update(pane, [x, y], label) {
    const at = pane.place(x, y);
    for (const part of this.parts) part.position.copy(at);
    this.ball.scale.setScalar(0.006 * pane.reach); this.rim.scale.setScalar(0.0085 * pane.reach);
    this.element.textContent = label;
  }

  remove(parent) { parent.remove(...this.parts); this.ball.geometry.dispose(); this.rim.geometry.dispose(); this.ball.material.dispose(); this.rim.material.dispose(); }
}

export class Marks {
  constructor(pane) {
    this.pane = pane;
    this.contacts = new Pool(pane.sheet, (parent, key) => new ContactMark(parent, key));
    this.others = new Pool(pane.sheet, (parent) => new ComparisonMark(parent));
    this.points = new Pool(pane.sheet, (parent, key) => new PointMark(parent, key));
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * ALONG), 3));
    this.path = new THREE.Line(geometry, new THREE.LineBasicMaterial({ depthTest: false, transparent: true }));
    this.path.renderOrder = 6; this.path.frustumCulled = false; this.path.visible = false;
    pane.sheet.add(this.path);
  }

  update(contacts, others, points, measured) {
    const { pane } = this;
    this.contacts.use(contacts.map(({ id }) => id), (mark, at) => mark.update(pane, contacts[at], contactLabel(contacts[at])));
    this.others.use(others.map(({ id }) => id), (mark, at) => mark.update(pane, others[at]));
    this.points.use(points.map((_, at) => "AB"[at]), (mark, at) => {
      const found = measured?.points[at];
      mark.update(pane, points[at], found ? `${mark.name}  ${withStd(found.depth_mm, found.std_mm, (v) => length(v, 1))} ${units.length}` : mark.name);
    });
    this.path.visible = points.length === 2;
    if (points.length === 2) {
      const { array } = this.path.geometry.attributes.position, [[x0, y0], [x1, y1]] = points;
      for (let i = 0; i < ALONG; i++) pane.place(x0 + ((x1 - x0) * i) / (ALONG - 1), y0 + ((y1 - y0) * i) / (ALONG - 1), 0.002 * pane.reach).toArray(array, 3 * i);
      this.path.geometry.attributes.position.needsUpdate = true;
      this.path.material.color.set(styled("--text"));
    }
    pane.isDirty = true;
  }
}

function contactLabel({ id, depth_mm, depth_std_mm, force_N, force_std_N }) {
  const depth = `${withStd(depth_mm, depth_std_mm, length)} ${units.length}`;
  const normalForce = isKnown(force_N) ? `${withStd(force_N, force_std_N, force)} ${units.force}` : "";
  const number = ["b", {}, `#${id}`];
  return normalForce ? [number, ` ${normalForce}`, ["br", {}], depth] : [number, ` ${depth}`];
}
