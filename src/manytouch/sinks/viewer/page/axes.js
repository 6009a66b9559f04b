// Outline of the sheet at rest, ticks along two edges and up one corner, with numbers and units.

import { CSS2DObject, THREE } from "./three.js";
import { styled } from "./colours.js";
import { fixed, niceCeiling, niceStep } from "./numbers.js";

export function label(text, kind) {
  const element = document.createElement("div");
  element.className = kind;
  element.textContent = text;
  return new CSS2DObject(element);
}

/** Pixels from one number of the depth axis to the next, of its shortest length, and of that from which on it has more than one. */
const NUMBER_PX = 18, SHORTEST_PX = 24, SEVERAL_PX = 40;

/**
 * Top and step of the depth axis, where a unit of depth takes `unit_px` on the screen: up to the deepest place with up to three
 * numbers; where this is too short for them, up to the first round number that has room, if it is not above `highest`.
 */
export function depthScale(deepest, unit_px, highest) {
  const top = niceCeiling(deepest), long_px = top * unit_px;
  if (long_px >= SEVERAL_PX) return { top, step: niceStep(top, Math.min(3, Math.floor(long_px / NUMBER_PX))) };
  const only = niceCeiling(Math.max(deepest, SHORTEST_PX / unit_px));
  return only <= highest ? { top: only, step: only } : { top: 0, step: 0 };
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

  /** The depth axis at the far left corner, up to `top` with a number every `step`; without a `top` there is none. */
  setHeight(top, step, stretch) {
    if (!this.tower || this.drawn === `${top} ${step} ${stretch}`) return;
    this.drawn = `${top} ${step} ${stretch}`;
    this.clear(this.tower);
    if (!top) return;
    const [x, y] = this.low, reach = Math.hypot(this.high[0] - x, this.high[1] - y), tick = 0.014 * reach;
    const points = [x, 0, y, x, top * stretch, y], digits = `${Number(step.toPrecision(2))}`.split(".")[1]?.length ?? 0;
    const addLabel = (text, kind, up, left) => { const found = label(text, kind); found.center.set(1, 0.5); found.position.set(x - left, up, y); this.tower.add(found); };
    for (let at = step; at <= top * 1.0001; at += step) { points.push(x, at * stretch, y, x - tick, at * stretch, y); addLabel(fixed(at, digits), "axis depth", at * stretch, 1.5 * tick); }
    const name = label(`depth (${this.unit})`, "axis name");
    name.center.set(0, 1.2); name.position.set(x, top * stretch, y); this.tower.add(name); // right of the numbers
    this.tower.add(this.lines(points));
  }

  lines(points) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    return new THREE.LineSegments(geometry, this.lineMaterial);
  }
}
