// Depth and force of each contact in the last seconds: rings of fixed size, so memory stays flat.

import { contactColour, styled } from "./colours.js";
import { inForce, inLength, niceCeiling, units } from "./numbers.js";
import { plot } from "./plot.js";

export const SPAN_S = 20;
const SIZE = 1024, MOST = 24, MOST_ROWS = 65536;
const COLUMNS = {
  x_mm: "x_mm", y_mm: "y_mm", depth_mm: "depth_mm", depth_std_mm: "depth_std_mm", normal_force_N: "force_N", force_std_N: "force_std_N",
  shear_x_N: ({ shear_N }) => shear_N[0], shear_y_N: ({ shear_N }) => shear_N[1], torque_Nmm: "torque_Nmm", slip: ({ slip }) => slip === null ? null : Number(slip),
};

/** What the page has shown of all contacts, the newest rows, in memory of fixed size. */
class Log {
  constructor() {
    this.count = 0;
    this.time = new Float64Array(MOST_ROWS); this.id = new Int32Array(MOST_ROWS);
    this.values = new Float32Array(MOST_ROWS * Object.keys(COLUMNS).length);
  }

  add(time, id, numbers) {
    const row = this.count++ % MOST_ROWS;
    this.time[row] = time; this.id[row] = id;
    numbers.forEach((value, at) => { this.values[row * numbers.length + at] = value ?? NaN; });
  }

  clear() { this.count = 0; }

  /** As a table in the columns of contacts.csv, of one contact or of all (null). */
  csv(id, unit) {
    const names = Object.keys(COLUMNS).map((name) => (unit === "mm" ? name : name.replace(/_mm$/, `_${unit}`)));
    const lines = [["time_s", "contact", ...names].join(",")], first = Math.max(0, this.count - MOST_ROWS);
    for (let i = first; i < this.count; i++) {
      const row = i % MOST_ROWS;
      if (id !== null && this.id[row] !== id) continue;
      const cells = names.map((_, at) => this.values[row * names.length + at]).map((value) => (Number.isNaN(value) ? "" : Number(value.toPrecision(6))));
      lines.push([this.time[row].toFixed(6), this.id[row], ...cells].join(","));
    }
    return lines.join("\n") + "\n";
  }
}

class Ring {
  constructor(id) {
    Object.assign(this, { id, count: 0, start: 0, last: -Infinity });
    for (const name of ["time", "depth", "force"]) this[name] = new Float32Array(SIZE);
  }

  add(time, depth, force) {
    const at = (this.start + this.count) % SIZE;
    this.time[at] = time; this.depth[at] = depth ?? NaN; this.force[at] = force ?? NaN;
    if (this.count < SIZE) this.count++; else this.start = (this.start + 1) % SIZE;
    this.last = time;
  }
}

export class History {
  constructor(depthCanvas, forceCanvas) {
    Object.assign(this, { depthCanvas, forceCanvas, rings: new Map(), now: -Infinity, log: new Log(), pinned: null });
  }

  /** Take an update; one that repeats a reading, for another layer or measurement, adds nothing. */
  add({ time_s, contacts, comparison }) {
    if (time_s === this.now) return;
    this.begin(time_s);
    this.now = time_s;
    for (const contact of contacts) {
      const numbers = Object.values(COLUMNS).map((of) => (typeof of === "string" ? contact[of] : of(contact)));
      this.log.add(time_s, contact.id, numbers);
      this.ring("", contact.id).add(time_s, contact.depth_mm, contact.force_N);
    }
    for (const { id, depth_mm, force_N } of comparison?.contacts ?? []) this.ring("comparison ", id).add(time_s, depth_mm, force_N);
    this.forget();
  }

  /** Take what was read before the page was opened, or while it was not connected. */
  recall({ time_s, columns, rows }) {
    if (time_s === null) return;
    this.begin(time_s);
    const order = Object.keys(COLUMNS).map((name) => columns.indexOf(name)), since = this.now;
    for (const [time, id, ...given] of rows) {
      if (time <= since) continue;
      const numbers = order.map((at) => given[at]), [, , depth, , force] = numbers;
      this.log.add(time, id, numbers);
      this.ring("", id).add(time, depth, force);
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

  draw(showComparison) {
    const xs = [-SPAN_S, 0];
    const tickLabel = (x) => (Math.abs(x) < 0.5 ? "now" : `−${Math.round(-x)} s`);
    const all = [...this.rings].filter(([key]) => showComparison || !key.startsWith("comparison"))
      .filter(([key]) => this.pinned === null || key === String(this.pinned));
    for (const [canvas, name, title, unit, convert] of [
      [this.depthCanvas, "depth", "depth", units.length, inLength],
      [this.forceCanvas, "force", "normal force", units.force, inForce],
    ]) {
      let most = 0, hasAny = false, isEstimated = false;
      const lines = all.map(([key, ring]) => {
        const y = new Float32Array(SIZE);
        const x = ring.time.map((at) => at - this.now);
        for (let i = 0; i < SIZE; i++) y[i] = convert(ring[name][i]);
        for (let i = 0; i < ring.count; i++) {
          const value = y[(ring.start + i) % SIZE];
          if (value === value) { hasAny = true; most = Math.max(most, value); isEstimated ||= !key.startsWith("comparison"); }
        }
        const isComparison = key.startsWith("comparison");
        return { x, y, count: ring.count, start: ring.start,
          colour: isComparison ? styled("--quiet") : contactColour(ring.id), dash: isComparison ? [4, 4] : [],
          label: !isComparison && ring.last === this.now ? `#${ring.id}` : "" };
      });
      const without = this.log.count ? `no contact in the last ${SPAN_S} s` : "no contact yet";
      const empty = name === "force" && !isEstimated && all.length ? "this method does not estimate forces" : hasAny ? "" : without;
      plot(canvas, { lines, xs, tickLabel, empty, ys: [0, niceCeiling(Math.max(1.12 * most, convert(0.5)))], title: `${title} (${unit})` });
    }
  }
}
