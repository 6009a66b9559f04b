// Depth and force of each contact in the last seconds: rings of fixed size, so memory stays flat.

import { contactColour, styled } from "./colours.js";
import { fixed, inForce, inLength, niceCeiling, units } from "./numbers.js";
import { plot } from "./plot.js";

export const SPAN_S = 20;
const SIZE = 1024, MOST = 24, MOST_ROWS = 65536;

/** What the page has shown of all contacts, the newest rows, in memory of fixed size. */
class Log {
  constructor() {
    Object.assign(this, { count: 0, columns: [], codes: {} });
  }

  /** The columns of contacts.csv after time and identity; `codes` has the texts of those that are places in a list. */
  setColumns(columns, codes) {
    if (this.columns.length) return;
    Object.assign(this, { columns, codes });
    this.time = new Float64Array(MOST_ROWS); this.id = new Int32Array(MOST_ROWS);
    this.values = new Float32Array(MOST_ROWS * columns.length);
  }

  add(time, id, numbers) {
    const row = this.count++ % MOST_ROWS, width = this.columns.length;
    this.time[row] = time; this.id[row] = id;
    for (let at = 0; at < width; at++) this.values[row * width + at] = numbers[at] ?? NaN;
  }

  clear() { this.count = 0; }

  /** As a table in the columns of contacts.csv, of one contact or of all (null). */
  csv(id, unit) {
    const names = this.columns.map((name) => (unit === "mm" ? name : name.replace(/_mm(2?)$/, `_${unit}$1`)));
    const lines = [[names[0], "time_s", "contact", ...names.slice(1)].join(",")], first = Math.max(0, this.count - MOST_ROWS);
    const write = (value, name) => (Number.isNaN(value) ? "" : this.codes[name] ? this.codes[name][value] : Number(value.toPrecision(6)));
    for (let i = first; i < this.count; i++) {
      const row = i % MOST_ROWS;
      if (id !== null && this.id[row] !== id) continue;
      const [frame, ...cells] = this.columns.map((name, at) => write(this.values[row * this.columns.length + at], name));
      lines.push([frame, this.time[row].toFixed(6), this.id[row], ...cells].join(","));
    }
    return lines.join("\n") + "\n";
  }
}

class Ring {
  constructor(id) {
    Object.assign(this, { id, count: 0, start: 0, last: -Infinity, hasForce: false });
    for (const name of ["time", "depth", "force"]) this[name] = new Float32Array(SIZE);
  }

  add(time, depth, force) {
    const at = (this.start + this.count) % SIZE;
    this.time[at] = time; this.depth[at] = depth ?? NaN; this.force[at] = force ?? NaN;
    this.hasForce ||= Number.isFinite(force);
    if (this.count < SIZE) this.count++; else this.start = (this.start + 1) % SIZE;
    this.last = time;
  }
}

export class History {
  constructor(depthCanvas, forceCanvas) {
    Object.assign(this, { depthCanvas, forceCanvas, rings: new Map(), now: -Infinity, log: new Log(), pinned: null, expectsForce: true });
  }

  /** Take a sensor: before its first contact there is a plot of forces if its modulus is known. */
  take({ has_newtons }) { this.expectsForce = has_newtons; }

  /** Take an update; one that repeats a reading, for another layer or measurement, adds nothing. */
  add({ time_s, contacts, comparison }) {
    if (time_s === this.now) return;
    this.begin(time_s);
    this.now = time_s;
    for (const contact of contacts) {
      this.log.add(time_s, contact.id, contact.row);
      this.ring("", contact.id).add(time_s, contact.depth_mm, contact.force_N);
    }
    for (const { id, depth_mm, force_N } of comparison?.contacts ?? []) this.ring("comparison ", id).add(time_s, depth_mm, force_N);
    this.forget();
  }

  /** Take what was read before the page was opened, or while it was not connected. */
  recall({ time_s, columns, codes, rows }) {
    this.log.setColumns(columns, codes);
    if (time_s === null) return;
    this.begin(time_s);
    const since = this.now, depth = columns.indexOf("depth_mm"), force = columns.indexOf("normal_force_N");
    for (const [time, id, ...numbers] of rows) {
      if (time <= since) continue;
      this.log.add(time, id, numbers);
      this.ring("", id).add(time, numbers[depth], numbers[force]);
    }
    this.now = time_s;
    this.forget();
  }

  /** A time before the last one is of another place of a recording: begin again. After a gap only the curves do. */
  begin(time_s) {
    if (time_s >= this.now && time_s <= this.now + SPAN_S) return;
    this.rings.clear();
    if (time_s >= this.now) return;
    this.log.clear();
    this.now = -Infinity;
  }

  ring(kind, id) {
    const key = kind + id;
    if (!this.rings.has(key)) this.rings.set(key, new Ring(id));
    return this.rings.get(key);
  }

  forget() {
    for (const [key, ring] of this.rings) if (ring.last < this.now - SPAN_S) this.rings.delete(key);
    while (this.rings.size > MOST) this.rings.delete(this.rings.keys().next().value);
  }

  /** Draw the curves; of a playback over the seconds of the recording, with a cursor at the present frame. */
  draw(showComparison, isPlayback) {
    const now = Number.isFinite(this.now) ? this.now : 0;
    const zero = isPlayback ? 0 : now, end = isPlayback ? Math.max(now, SPAN_S) : 0;
    const xs = [end - SPAN_S, end];
    const tickLabel = isPlayback ? (x, step) => `${fixed(x, step < 1 ? 1 : 0)} s` : (x) => (Math.abs(x) < 0.5 ? "now" : `−${Math.round(-x)} s`);
    const marks = isPlayback && Number.isFinite(this.now) ? [{ x: now, text: "" }] : [];
    const all = [...this.rings].filter(([key]) => showComparison || !key.startsWith("comparison"))
      .filter(([key]) => this.pinned === null || key === String(this.pinned));
    if (all.length) this.expectsForce = all.some(([, ring]) => ring.hasForce);
    this.forceCanvas.hidden = !this.expectsForce;
    this.forceCanvas.parentElement.classList.toggle("single", !this.expectsForce);
    for (const [canvas, name, title, unit, convert] of [
      [this.depthCanvas, "depth", "depth", units.length, inLength],
      [this.forceCanvas, "force", "normal force", units.force, inForce],
    ]) {
      let most = 0, hasAny = false;
      const lines = all.map(([key, ring]) => {
        const y = new Float32Array(SIZE);
        const x = ring.time.map((at) => at - zero);
        for (let i = 0; i < SIZE; i++) y[i] = convert(ring[name][i]);
        for (let i = 0; i < ring.count; i++) {
          const value = y[(ring.start + i) % SIZE];
          if (value === value) { hasAny = true; most = Math.max(most, value); }
        }
        const isComparison = key.startsWith("comparison"), isNow = ring.last === this.now;
        return { x, y, count: ring.count, start: ring.start,
          colour: isComparison ? styled("--quiet") : contactColour(ring.id), dash: isComparison ? [4, 4] : [],
          label: !isComparison && isNow ? `#${ring.id}` : "", name: !isComparison && !isNow ? `#${ring.id}` : "" };
      });
      const without = this.log.count ? `no contact in the last ${SPAN_S} s` : "no contact yet";
      plot(canvas, { lines, xs, tickLabel, marks, empty: hasAny ? "" : without, ys: [0, niceCeiling(Math.max(1.12 * most, convert(0.5)))], title: `${title} (${unit})` });
    }
  }
}
