// The surface in a browser without WebGL: a flat map of the same values with the same contacts and points.

import { contactColour, styled, table } from "./colours.js";
import { fixed, force, isKnown, length, niceStep, units, withStd } from "./numbers.js";
import { NARROW_PX, freePlace } from "./label_places.js";
import { sized } from "./plot.js";

/** Room around the map: the colours are at its left, in a narrow pane above it, below the tools for pressing. */
const margins = (width, isPress) => (width < NARROW_PX ? { left: 22, right: 40, above: isPress ? 224 : 140, below: 84 } : { left: 104, right: 40, above: 52, below: 84 });

/** Takes the place of `SurfacePane`: the same methods, on a canvas in two dimensions. */
export class FlatPane {
  constructor(stage) {
    Object.assign(this, { stage, isFlat: true, stretch: 1, side: 1, isDirty: true, depth: null, x: [], y: [], controls: {}, marks: null });
    this.canvas = document.createElement("canvas");
    this.image = document.createElement("canvas"); // a pixel per point of the grid
    this.renderer = { domElement: this.canvas };
    stage.append(this.canvas);
    this.setMap("cividis");
    new ResizeObserver(() => { this.isDirty = true; }).observe(stage);
  }

  build({ x_mm, y_mm, unit }) {
    Object.assign(this, { x: x_mm, y: y_mm, unit });
    this.image.width = x_mm.length; this.image.height = y_mm.length;
    this.reach = Math.hypot(x_mm.at(-1) - x_mm[0], y_mm.at(-1) - y_mm[0]);
    this.isDirty = true;
  }

  update(depth, value, low, high, contour, support) {
    const { width, height } = this.image;
    if (depth.length !== width * height) return;
    this.depth = depth;
    const context = this.image.getContext("2d"), pixels = context.createImageData(width, height);
    for (let at = 0; at < depth.length; at++) {
      const isShown = value[at] === value[at] && (!support || support[at]);
      const step = Math.round(255 * Math.min(Math.max((value[at] - low) / (high - low), 0), 1)) || 0;
      if (isShown) pixels.data.set(this.table.subarray(4 * step, 4 * step + 4), 4 * at);
    }
    context.putImageData(pixels, 0, 0);
    this.isDirty = true;
  }

  setMap(name) { this.table = table(name); this.isDirty = true; }
  recolour() { this.isDirty = true; }
  setSide(side) { this.side = side; this.isDirty = true; }
  home() { this.isDirty = true; }

  /** Offset and scale from millimetres to pixels of the canvas. */
  frame() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const wide = this.x.at(-1) - this.x[0], high = this.y.at(-1) - this.y[0];
    const { left, right, above, below } = margins(width, this.stage.classList.contains("press")), across = width - left - right, down = height - above - below;
    const scale = Math.max(Math.min(across / wide, down / high), 1e-6);
    return { scale, left: left + (across - scale * wide) / 2, top: above + (down - scale * high) / 2, wide, high };
  }

  toCanvas(x, y) {
    const { scale, left, top, wide } = this.frame(), along = scale * (x - this.x[0]);
    return [left + (this.side > 0 ? along : scale * wide - along), top + scale * (y - this.y[0])];
  }

  onScreen(x, y) {
    const box = this.canvas.getBoundingClientRect(), [px, py] = this.toCanvas(x, y);
    return [box.left + px, box.top + py];
  }

  pick({ clientX, clientY }) {
    if (!this.x.length) return null;
    const box = this.canvas.getBoundingClientRect(), { scale, left, top, wide, high } = this.frame();
    const along = (clientX - box.left - left) / scale, y = (clientY - box.top - top) / scale;
    if (along < 0 || along > wide || y < 0 || y > high) return null;
    return [this.x[0] + (this.side > 0 ? along : wide - along), this.y[0] + y];
  }

  render() {
    if (!this.isDirty) return false;
    this.isDirty = false;
    const { context, width } = sized(this.canvas);
    if (!this.x.length || width < 40) return true;
    const { scale, left, top, wide, high } = this.frame();
    context.fillStyle = hatching(context);
    context.fillRect(left, top, scale * wide, scale * high);
    context.save();
    if (this.side < 0) { context.translate(2 * left + scale * wide, 0); context.scale(-1, 1); }
    if (this.depth) context.drawImage(this.image, left, top, scale * wide, scale * high);
    context.restore();
    this.drawAxes(context, { scale, left, top, wide, high });
    this.marks?.draw(context);
    return true;
  }

  drawAxes(context, { scale, left, top, wide, high }) {
    const step = niceStep(Math.max(wide, high), 6), digits = step < 1 ? 1 : 0;
    context.strokeStyle = context.fillStyle = styled("--quiet"); context.lineWidth = 1;
    context.strokeRect(left, top, scale * wide, scale * high);
    context.font = "11.5px system-ui, sans-serif"; context.textAlign = "center"; context.textBaseline = "top";
    const bottom = top + scale * high;
    for (let x = Math.ceil(this.x[0] / step) * step; x <= this.x.at(-1); x += step) context.fillText(fixed(x, digits), this.toCanvas(x, 0)[0], bottom + 5);
    context.fillText(`x (${this.unit})`, left + (scale * wide) / 2, bottom + 20);
    context.textAlign = "left"; context.textBaseline = "middle";
    const right = left + scale * wide + 5;
    for (let y = Math.ceil(this.y[0] / step) * step; y <= this.y.at(-1); y += step) context.fillText(fixed(y, digits), right, this.toCanvas(0, y)[1]);
    context.textBaseline = "bottom"; context.textAlign = "right";
    context.fillText(`y (${this.unit})`, right + 22, top - 6);
  }
}

function hatching(context) {
  const tile = document.createElement("canvas");
  tile.width = tile.height = 8;
  const pen = tile.getContext("2d");
  pen.strokeStyle = styled("--quiet"); pen.lineWidth = 1;
  for (const shift of [-8, 0, 8]) { pen.moveTo(shift, 8); pen.lineTo(shift + 8, 0); }
  pen.stroke();
  return context.createPattern(tile, "repeat");
}

/** Takes the place of `Marks`. */
export class FlatMarks {
  constructor(pane) { Object.assign(this, { pane, contacts: [], others: [], points: [], measured: null }); pane.marks = this; }

  update(contacts, others, points, measured) {
    Object.assign(this, { contacts, others, points, measured });
    this.pane.isDirty = true;
  }

  draw(context) {
    const { pane } = this, { clientWidth } = pane.canvas, taken = [clientWidth < NARROW_PX ? [0, 0, clientWidth, 70] : [0, 0, 104, 190]];
    const polygon = (corners) => {
      context.beginPath();
      corners.forEach(([x, y]) => context.lineTo(...pane.toCanvas(x, y)));
      context.closePath(); context.stroke();
    };
    context.lineWidth = 2;
    const { scale, left, top, wide, high } = pane.frame();
    context.save();
    context.beginPath(); context.rect(left, top, scale * wide, scale * high); context.clip(); // estimates may reach beyond the sheet
    for (const { outline_mm, id } of this.contacts) { context.strokeStyle = contactColour(id); (outline_mm ?? []).forEach(polygon); }
    context.restore();
    for (const { x_mm, y_mm, area_mm2 } of this.others) {
      const [x, y] = pane.toCanvas(x_mm, y_mm), radius = Math.sqrt((area_mm2 ?? 0) / Math.PI) || 0.02 * pane.reach;
      context.strokeStyle = "#fff"; context.setLineDash([4, 3]);
      context.beginPath(); context.arc(x, y, radius * pane.frame().scale, 0, 2 * Math.PI); context.stroke(); context.setLineDash([]);
    }
    for (const contact of this.contacts) {
      context.strokeStyle = contactColour(contact.id);
      const [x, y] = pane.toCanvas(contact.x_mm, contact.y_mm);
      context.beginPath(); context.arc(x, y, 6, 0, 2 * Math.PI); context.stroke();
      const text = isKnown(contact.force_N) ? `${withStd(contact.force_N, contact.force_std_N, force)} ${units.force}` : `${withStd(contact.depth_mm, contact.depth_std_mm, length)} ${units.length}`;
      this.tag(context, `#${contact.id}  ${text}`, x, y, contactColour(contact.id), taken);
    }
    context.strokeStyle = styled("--text");
    if (this.points.length === 2) polygon(this.points);
    this.points.forEach((point, at) => {
      const [x, y] = pane.toCanvas(...point), found = this.measured?.points[at];
      context.fillStyle = "#fff"; context.beginPath(); context.arc(x, y, 4, 0, 2 * Math.PI); context.fill(); context.stroke();
      this.tag(context, found ? `${"AB"[at]}  ${withStd(found.depth_mm, found.std_mm, (v) => length(v, 1))} ${units.length}` : "AB"[at], x, y, styled("--text"), taken);
    });
  }

  tag(context, text, x, y, colour, taken) {
    context.font = "600 12px system-ui, sans-serif";
    const size = [context.measureText(text).width + 14, 20];
    const [left, top] = freePlace([x, y], size, [this.pane.canvas.clientWidth, this.pane.canvas.clientHeight], taken);
    taken.push([left, top, ...size]);
    context.fillStyle = styled("--card"); context.strokeStyle = colour; context.lineWidth = 1.5;
    context.beginPath(); context.roundRect(left, top, ...size, 6); context.fill(); context.stroke();
    context.fillStyle = styled("--text"); context.textAlign = "left"; context.textBaseline = "middle";
    context.fillText(text, left + 7, top + size[1] / 2);
  }
}
