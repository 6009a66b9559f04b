// The camera image with markers, displacement arrows and contacts.

import { contactColour } from "./colours.js";
import { sized } from "./plot.js";

const SKY = "#6cc4f5", LOST = "#ff7a3d", ARROW = "#f7e04b";

export class CameraPane {
  constructor(canvas) {
    Object.assign(this, { canvas, picture: null, sceneInfo: null, busy: false, next: null });
    this.options = { ids: false, arrows: true, gain: 3 };
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
  }

  addArrow(path, x, y, dx, dy) {
    const long = Math.hypot(dx, dy);
    if (long < 2) return;
    const head = Math.min(4, 0.45 * long), ux = dx / long, uy = dy / long, ex = x + dx, ey = y + dy;
    path.moveTo(x, y); path.lineTo(ex, ey);
    path.moveTo(ex - head * (ux + 0.6 * uy), ey - head * (uy - 0.6 * ux)); path.lineTo(ex, ey);
    path.lineTo(ex - head * (ux - 0.6 * uy), ey - head * (uy + 0.6 * ux));
  }

  drawIds(context, markers, rest, place, pitch) {
    const size = Math.max(6, Math.min(0.42 * pitch, 11));
    context.font = `${size}px system-ui, sans-serif`;
    context.textAlign = "center"; context.textBaseline = "middle"; context.lineWidth = 2.5; context.strokeStyle = "rgb(0 0 0 / 75%)"; context.fillStyle = "#fff";
    for (let m = 0; m < rest.length; m++) {
      const x = markers[2 * m], y = markers[2 * m + 1];
      if (Number.isNaN(x)) continue;
      const [px, py] = place(x, y);
      context.strokeText(m, px, py); context.fillText(m, px, py);
    }
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
    context.font = "700 12px system-ui, sans-serif"; context.textAlign = "left"; context.textBaseline = "middle";
    context.lineWidth = 3.5; context.strokeStyle = "rgb(0 0 0 / 75%)"; context.fillStyle = "#fff";
    context.strokeText(`#${contact.id}`, x + 14, y - 9); context.fillText(`#${contact.id}`, x + 14, y - 9);
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
