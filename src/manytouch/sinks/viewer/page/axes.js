// Outline of the sheet at rest, ticks along two edges and up one corner, with numbers and units.

import { CSS2DObject, THREE } from "./three.js";
import { styled } from "./colours.js";
import { fixed, niceStep } from "./numbers.js";

export function label(text, kind) {
  const element = document.createElement("div");
  element.className = kind;
  element.textContent = text;
  return new CSS2DObject(element);
}

export class Axes {
  constructor(parent) {
    this.group = new THREE.Group();
    parent.add(this.group);
    this.lineMaterial = new THREE.LineBasicMaterial();
    this.recolour();
  }

  recolour() { this.lineMaterial.color.set(styled("--quiet")); }

  clear(group) {
    for (const child of [...group.children]) {
      group.remove(child);
      child.geometry?.dispose();
      child.element?.remove();
    }
  }

  /** Draw for a grid; gives the distance of the ticks. */
  build(x, y, unit) {
    this.clear(this.group);
    Object.assign(this, { low: [x[0], y[0]], high: [x[x.length - 1], y[y.length - 1]], unit, drawn: "" });
    const [x0, y0] = this.low, [x1, y1] = this.high, reach = Math.hypot(x1 - x0, y1 - y0);
    const step = niceStep(Math.max(x1 - x0, y1 - y0), 6), tick = 0.014 * reach, away = 0.035 * reach;
    const points = [x0, y0, x1, y0, x1, y0, x1, y1, x1, y1, x0, y1, x0, y1, x0, y0].reduce((all, value, i, list) => (i % 2 ? all : [...all, value, 0, list[i + 1]]), []);
    const addLabel = (text, kind, px, py) => { const found = label(text, kind); found.position.set(px, 0, py); this.group.add(found); };
    const digits = step < 1 ? 1 : 0;
    for (let at = Math.ceil(x0 / step) * step; at <= x1; at += step) { points.push(at, 0, y1, at, 0, y1 + tick); addLabel(fixed(at, digits), "axis", at, y1 + away); }
    for (let at = Math.ceil(y0 / step) * step; at <= y1; at += step) { points.push(x1, 0, at, x1 + tick, 0, at); addLabel(fixed(at, digits), "axis", x1 + 1.2 * away, at); }
    addLabel(`x (${unit})`, "axis name", (x0 + x1) / 2, y1 + 2.3 * away);
    addLabel(`y (${unit})`, "axis name", x1 + 2.6 * away, (y0 + y1) / 2);
    this.group.add(this.lines(points));
    this.tower = new THREE.Group();
    this.group.add(this.tower);
    return step;
  }

  /** The depth axis at the far left corner, up to `most`. */
  setHeight(most, stretch) {
    if (!this.tower || this.drawn === `${most} ${stretch}`) return;
    this.drawn = `${most} ${stretch}`;
    this.clear(this.tower);
    const [x, y] = this.low, reach = Math.hypot(this.high[0] - x, this.high[1] - y), tick = 0.014 * reach;
    const points = [x, 0, y, x, most * stretch, y], step = niceStep(most, 3);
    const addLabel = (text, kind, up, left) => { const found = label(text, kind); found.center.set(1, 0.5); found.position.set(x - left, up, y); this.tower.add(found); };
    for (let at = step; at <= most * 1.0001; at += step) { points.push(x, at * stretch, y, x - tick, at * stretch, y); addLabel(fixed(at, step < 0.1 ? 2 : step < 1 ? 1 : 0), "axis", at * stretch, 1.5 * tick); }
    const name = label(`depth (${this.unit})`, "axis name");
    name.center.set(0.15, 1.2); name.position.set(x, most * stretch, y); this.tower.add(name);
    this.tower.add(this.lines(points));
  }

  lines(points) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    return new THREE.LineSegments(geometry, this.lineMaterial);
  }
}
