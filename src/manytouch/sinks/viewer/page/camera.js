// The camera image with markers, their displacement arrows, contacts and shear forces.

import { contactColour } from "./colours.js";
import { freePlace, overlaps } from "./label_places.js";
import { isKnown } from "./numbers.js";
import { sized } from "./plot.js";

const SHEAR_PX_PER_N = 20, MOST_SHEAR_PX = 90, FAR_NAME_PX = 24;
const SKY = "#6cc4f5", LOST = "#ff7a3d", ARROW = "#f7e04b";

export class CameraPane {
  constructor(canvas) {
    Object.assign(this, { canvas, picture: null, sceneInfo: null, busy: false, next: null });
    this.options = { ids: false, arrows: true, gain: 3 };
    this.hovered = null;
    canvas.addEventListener("pointermove", ({ offsetX, offsetY }) => { this.hovered = [offsetX, offsetY]; });
    canvas.addEventListener("pointerleave", () => { this.hovered = null; });
  }

  /** Decode an image; of those that arrive meanwhile only the newest is kept. */
  async show(jpeg, done) {
    this.next = jpeg;
    if (this.busy) return;
    this.busy = true;
    while (this.next) {
      const blob = new Blob([this.next], { type: "image/jpeg" });
      this.next = null;
      try {
        const picture = await createImageBitmap(blob);
        this.picture?.close();
        this.picture = picture;
        done();
      } catch { /* a damaged image of the camera: the previous one stays */ }
    }
    this.busy = false;
  }

  draw(markers, contacts, others) {
    const { context, width, height } = sized(this.canvas);
    if (!this.sceneInfo || width < 10) return;
    const [wide, high] = this.sceneInfo.image_px;
    const scale = Math.min(width / wide, height / high);
    const left = (width - wide * scale) / 2, top = (height - high * scale) / 2;
    const place = (x, y) => [left + (x + 0.5) * scale, top + (y + 0.5) * scale];
    if (this.picture) context.drawImage(this.picture, left, top, wide * scale, high * scale);
    if (markers) this.drawMarkers(context, markers, place, scale);
    for (const contact of others) this.drawContact(context, contact, place, true);
    for (const contact of contacts) this.drawContact(context, contact, place, false);
    const rings = contacts.filter(({ px }) => px[0] !== null).map((contact) => [contact, place(...contact.px)]);
    const taken = rings.map(([, [x, y]]) => [x - 9, y - 9, 18, 18]);
    for (const [contact, at] of rings) this.drawName(context, contact, at, [width, height], taken);
  }

  drawMarkers(context, markers, place, scale) {
    const rest = this.sceneInfo.rest_px, { arrows, gain, ids } = this.options;
    const pitch = this.pitchPx(rest) * scale, radius = Math.max(1.2, Math.min(0.2 * pitch, 5));
    const seen = new Path2D(), lost = new Path2D(), shafts = new Path2D();
    for (let m = 0; m < rest.length; m++) {
      const x = markers[2 * m], y = markers[2 * m + 1];
      const [rx, ry] = place(...rest[m]);
      if (Number.isNaN(x)) {
        lost.moveTo(rx - radius, ry - radius); lost.lineTo(rx + radius, ry + radius);
        lost.moveTo(rx - radius, ry + radius); lost.lineTo(rx + radius, ry - radius);
        continue;
      }
      const [px, py] = place(x, y);
      seen.moveTo(px + radius, py); seen.arc(px, py, radius, 0, 2 * Math.PI);
      if (arrows) this.addArrow(shafts, px, py, (px - rx) * gain, (py - ry) * gain);
    }
    context.lineWidth = 1; context.strokeStyle = SKY; context.globalAlpha = 0.75; context.stroke(seen); context.globalAlpha = 1;
    context.lineWidth = 1.6; context.strokeStyle = LOST; context.stroke(lost);
    context.lineWidth = 2.8; context.strokeStyle = "rgb(0 0 0 / 55%)"; context.stroke(shafts);
    context.lineWidth = 1.4; context.strokeStyle = ARROW; context.stroke(shafts);
    if (ids) this.drawIds(context, markers, rest, place, pitch);
    this.drawHovered(context, markers, place, pitch);
  }

  addArrow(path, x, y, dx, dy) {
    const long = Math.hypot(dx, dy);
    if (long < 2) return;
    const head = Math.min(4, 0.45 * long), ux = dx / long, uy = dy / long, ex = x + dx, ey = y + dy;
    path.moveTo(x, y); path.lineTo(ex, ey);
    path.moveTo(ex - head * (ux + 0.6 * uy), ey - head * (uy - 0.6 * ux)); path.lineTo(ex, ey);
    path.lineTo(ex - head * (ux - 0.6 * uy), ey - head * (uy + 0.6 * ux));
  }

  /** Numbers of the markers, as many as are legible without overlap, and of the marker under the mouse. */
  drawIds(context, markers, rest, place, pitch) {
    const size = 11, cells = new Map();
    context.font = `${size}px system-ui, sans-serif`;
    context.textAlign = "center"; context.textBaseline = "middle"; context.lineWidth = 2.5; context.strokeStyle = "rgb(0 0 0 / 75%)"; context.fillStyle = "#fff";
    const wide = context.measureText(String(rest.length - 1)).width + 3, high = size + 2;
    for (let m = 0; m < rest.length; m++) {
      if (Number.isNaN(markers[2 * m])) continue;
      const [rx, ry] = place(...rest[m]), column = Math.floor(rx / wide), row = Math.floor(ry / high);
      const mine = [rx - wide / 2, ry - high / 2, wide, high];
      const near = [-1, 0, 1].flatMap((a) => [-1, 0, 1].flatMap((b) => cells.get(`${column + a} ${row + b}`) ?? []));
      if (near.some((other) => overlaps(mine, other))) continue;
      cells.set(`${column} ${row}`, [...(cells.get(`${column} ${row}`) ?? []), mine]);
      const [px, py] = place(markers[2 * m], markers[2 * m + 1]);
      context.strokeText(m, px, py); context.fillText(m, px, py);
    }
  }

  drawHovered(context, markers, place, pitch) {
    if (!this.hovered) return;
    let best = null, least = Math.max(0.6 * pitch, 8);
    for (let m = 0; m < this.sceneInfo.rest_px.length; m++) {
      const [x, y] = place(markers[2 * m], markers[2 * m + 1]), away = Math.hypot(x - this.hovered[0], y - this.hovered[1]);
      if (away < least) { least = away; best = { m, x, y }; }
    }
    if (!best) return;
    context.font = "700 13px system-ui, sans-serif"; context.textAlign = "center"; context.textBaseline = "middle";
    const text = `marker ${best.m}`, wide = context.measureText(text).width + 10, left = Math.min(Math.max(best.x - wide / 2, 2), this.canvas.clientWidth - wide - 2);
    const top = best.y > 30 ? best.y - 28 : best.y + 10;
    context.fillStyle = "rgb(0 0 0 / 80%)"; context.fillRect(left, top, wide, 20);
    context.fillStyle = "#fff"; context.fillText(text, left + wide / 2, top + 10);
  }

  drawContact(context, contact, place, isComparison) {
    if (contact.px[0] === null) return;
    const [x, y] = place(...contact.px);
    context.setLineDash(isComparison ? [3, 3] : []);
    if (contact.outline_px) this.drawOutline(context, contact, place, isComparison);
    context.beginPath(); context.arc(x, y, isComparison ? 13 : 10, 0, 2 * Math.PI);
    if (!isComparison) {
      context.lineWidth = 4.5; context.strokeStyle = "rgb(0 0 0 / 60%)"; context.stroke();
      context.lineWidth = 2.5;
    } else context.lineWidth = 1.5;
    context.strokeStyle = isComparison ? "#fff" : contactColour(contact.id); context.stroke();
    context.setLineDash([]);
    if (isComparison) return;
    this.drawShear(context, contact, x, y);
  }

  /** The direction and size of the shear force; y of the sheet points down in the image. */
  drawShear(context, { id, shear_N: [sx, sy] }, x, y) {
    const size = Math.hypot(sx, sy);
    if (!isKnown(sx) || !isKnown(sy) || size < 0.05) return;
    const path = new Path2D(), longest = Math.min(SHEAR_PX_PER_N * size, MOST_SHEAR_PX) / size;
    this.addArrow(path, x, y, sx * longest, sy * longest);
    context.lineWidth = 5; context.strokeStyle = "rgb(0 0 0 / 60%)"; context.stroke(path);
    context.lineWidth = 2.5; context.strokeStyle = contactColour(id); context.stroke(path);
  }

  drawName(context, { id, slip }, [x, y], size, taken) {
    context.font = "700 12px system-ui, sans-serif"; context.textAlign = "left"; context.textBaseline = "middle";
    const text = slip ? `#${id} slips` : `#${id}`, wide = context.measureText(text).width + 4;
    const [left, top] = freePlace([x + 0.5 * wide + 12, y], [wide, 15], size, taken, 2);
    taken.push([left, top, wide, 15]);
    const nearest = [Math.min(Math.max(x, left), left + wide), Math.min(Math.max(y, top), top + 15)];
    if (Math.hypot(nearest[0] - x, nearest[1] - y) > FAR_NAME_PX) {
      context.lineWidth = 1.5; context.strokeStyle = contactColour(id);
      context.beginPath(); context.moveTo(x, y); context.lineTo(...nearest); context.stroke();
    }
    context.lineWidth = 3.5; context.strokeStyle = "rgb(0 0 0 / 75%)"; context.fillStyle = "#fff";
    context.strokeText(text, left + 2, top + 8); context.fillText(text, left + 2, top + 8);
  }

  drawOutline(context, contact, place, isComparison) {
    const path = new Path2D();
    for (const ring of contact.outline_px) {
      ring.forEach(([x, y], at) => (at ? path.lineTo(...place(x, y)) : path.moveTo(...place(x, y))));
      path.closePath();
    }
    context.lineWidth = 3; context.strokeStyle = "rgb(0 0 0 / 60%)"; context.stroke(path);
    context.lineWidth = 1.3; context.strokeStyle = isComparison ? "#fff" : contactColour(contact.id); context.stroke(path);
  }

  pitchPx(rest) {
    if (this.pitchOf !== rest) {
      const [x, y] = rest[Math.floor(rest.length / 2)];
      const away = rest.map(([a, b]) => Math.hypot(a - x, b - y)).filter((d) => d > 0);
      this.pitch = Math.min(...away); this.pitchOf = rest;
    }
    return this.pitch;
  }
}
