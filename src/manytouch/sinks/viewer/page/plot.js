// Lines over an axis on a canvas: round ticks, light grid, nothing else.

import { styled } from "./colours.js";
import { freePlace, overlaps } from "./label_places.js";
import { fixed, niceStep } from "./numbers.js";

const MOST_AWAY_PX = 80; // of the name of a curve from its highest point

/** Fit a canvas's pixels to its place on the screen; gives its context in CSS pixels, and its size. */
export function sized(canvas) {
  const ratio = Math.min(devicePixelRatio || 1, 2);
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

/**
 * Draw lines. `lines`: [{ x, y, count, start, colour, dash, label, name, std }], arrays may be rings begun at `start`;
 * `label` stands at the end of a line, `name` at its highest point.
 * `xs`, `ys`: [low, high]; `title` above; `empty` is the text shown when there is nothing to draw.
 */
export function plot(canvas, { lines, xs, ys, title, tickLabel, empty, marks = [] }) {
  const { context, width, height } = sized(canvas);
  if (width < 40 || height < 40) return;
  context.font = "600 11.5px system-ui, sans-serif";
  const named = lines.filter((line) => line.label).map((line) => context.measureText(line.label).width);
  const left = 46, right = named.length ? Math.max(...named) + 16 : 14, top = 28, bottom = 22;
  const textColour = styled("--text"), quiet = styled("--quiet"), rule = styled("--line");
  const toX = (x) => left + ((x - xs[0]) / (xs[1] - xs[0])) * (width - left - right);
  const toY = (y) => height - bottom - ((y - ys[0]) / (ys[1] - ys[0])) * (height - top - bottom);
  context.font = "11.5px system-ui, sans-serif";
  context.lineWidth = 1;
  context.textBaseline = "middle";
  const stepY = niceStep(ys[1] - ys[0], Math.max(2, (height - top - bottom) / 34));
  const digits = Math.max(0, -Math.floor(Math.log10(stepY) + 1e-9));
  context.textAlign = "right";
  for (let y = Math.ceil(ys[0] / stepY - 1e-9) * stepY; y <= ys[1] + 1e-9 * stepY; y += stepY) {
    context.strokeStyle = rule;
    context.beginPath(); context.moveTo(left, toY(y)); context.lineTo(width - right, toY(y)); context.stroke();
    context.fillStyle = quiet;
    context.fillText(fixed(y, digits), left - 6, toY(y));
  }
  const stepX = niceStep(xs[1] - xs[0], Math.max(2, (width - left - right) / 80));
  context.textAlign = "center";
  context.fillStyle = quiet;
  for (let x = Math.ceil(xs[0] / stepX - 1e-9) * stepX; x <= xs[1] + 1e-9 * stepX; x += stepX) {
    context.fillText(tickLabel(x, stepX), Math.min(Math.max(toX(x), left), width - right - 8), height - 10);
  }
  context.textAlign = "left";
  context.fillStyle = textColour;
  context.font = "600 12px system-ui, sans-serif";
  context.fillText(title, 10, 11);
  context.font = "11.5px system-ui, sans-serif";
  if (empty) {
    context.textAlign = "center";
    context.fillStyle = quiet;
    context.fillText(empty, (left + width - right) / 2, (top + height - bottom) / 2);
  }
  context.save();
  context.beginPath(); context.rect(left, top - 6, width - left - right, height - top - bottom + 12); context.clip();
  const drawn = lines.map((line) => drawLine(context, line, toX, toY)).filter(Boolean), ends = drawn.filter(({ label }) => label);
  for (const { x, text } of marks) {
    context.strokeStyle = quiet; context.setLineDash([3, 3]);
    context.beginPath(); context.moveTo(toX(x), top); context.lineTo(toX(x), height - bottom); context.stroke();
    context.setLineDash([]); context.fillStyle = textColour; context.textAlign = "center";
    context.fillText(text, toX(x), top - 1);
  }
  writeNames(context, drawn.filter(({ name, highest }) => name && highest), [left, top - 6, width - left - right, height - top - bottom + 6]);
  context.restore();
  writeEnds(context, ends, top, height - bottom);
}

/** Names at the highest points of lines, as many as have room; the first are the newest. */
function writeNames(context, drawn, [left, top, width, height]) {
  context.font = "600 11.5px system-ui, sans-serif"; context.textAlign = "left"; context.textBaseline = "middle";
  const taken = [];
  for (const { highest: [x, y], name, colour } of drawn.reverse()) {
    const size = [context.measureText(name).width + 8, 13];
    const [at, above] = freePlace([x - left, y - top], size, [width, height], taken, 3);
    const isFar = Math.hypot(at + size[0] / 2 - (x - left), above + 6.5 - (y - top)) > MOST_AWAY_PX;
    if (isFar || taken.some((other) => overlaps([at, above, ...size], other))) continue;
    taken.push([at, above, ...size]);
    context.fillStyle = colour; context.fillRect(left + at, top + above + 2, 3, 9);
    context.lineWidth = 3; context.lineJoin = "round"; context.strokeStyle = styled("--stage"); context.fillStyle = styled("--text");
    context.strokeText(name, left + at + 6, top + above + 7); context.fillText(name, left + at + 6, top + above + 7);
  }
}

/** Names at the ends of lines, pushed apart where they would cover each other. */
function writeEnds(context, ends, top, bottom) {
  const apart = 12;
  ends.sort((a, b) => a.y - b.y);
  for (let i = 0, last = top - apart; i < ends.length; i++) last = ends[i].y = Math.max(ends[i].y, last + apart);
  for (let i = ends.length - 1, next = bottom + apart; i >= 0; i--) next = ends[i].y = Math.min(ends[i].y, next - apart);
  context.font = "600 11.5px system-ui, sans-serif"; context.textAlign = "left"; context.textBaseline = "middle";
  for (const { x, y, label, colour } of ends) {
    context.fillStyle = colour; context.fillRect(x + 4, y - 5, 3, 9);
    context.fillStyle = styled("--text"); context.fillText(label, x + 10, y); // yellow text is not legible on white
  }
}

function drawLine(context, { x, y, count, start = 0, colour, dash = [], label, name, std }, toX, toY) {
  const size = x.length;
  if (std) {
    context.fillStyle = colour; context.globalAlpha = 0.2; context.beginPath();
    for (let i = 0; i < count; i++) context.lineTo(toX(x[i]), toY(y[i] + std[i]));
    for (let i = count - 1; i >= 0; i--) context.lineTo(toX(x[i]), toY(y[i] - std[i]));
    context.fill(); context.globalAlpha = 1;
  }
  context.strokeStyle = colour; context.lineWidth = 1.8; context.setLineDash(dash); context.lineJoin = "round";
  context.beginPath();
  let isDown = false, last = null, highest = null; // of what is visible: a single point is not
  for (let i = 0; i < count; i++) {
    const at = (start + i) % size;
    if (Number.isNaN(y[at])) { isDown = false; continue; }
    const place = [toX(x[at]), toY(y[at])];
    if (isDown) context.lineTo(...place); else context.moveTo(...place);
    if (isDown) highest = [highest ?? last, last, place].reduce((a, b) => (b[1] < a[1] ? b : a));
    isDown = true; last = place;
  }
  context.stroke(); context.setLineDash([]);
  return last ? { x: last[0], y: last[1], highest, label, name, colour } : null;
}
