// Tables of contacts, measures and health.

import { contactColour, styled } from "./colours.js";
import { fixed, force, inLength, isKnown, length, niceCeiling, units, withStd } from "./numbers.js";
import { plot } from "./plot.js";

const find = (id) => document.getElementById(id);
const small = (value, std, write) => (isKnown(std) ? `${write(value)} <small>± ${write(std)}</small>` : write(value));
const write = (element, html) => { if (element.dataset.html !== html) { element.dataset.html = html; element.innerHTML = html; } };

/** One line per contact, and the nearest one of those it is shown beside under it. */
export function showContacts(contacts, others, name, reach) {
  write(find("contacts").tHead, `<tr><th></th><th>x<br>${units.length}</th><th>y<br>${units.length}</th><th>depth<br>${units.length}</th><th>force<br>${units.force}</th></tr>`);
  const rows = contacts.map((contact) => {
    const own = `<tr><td><i style="background:${contactColour(contact.id)}"></i><b>${contact.id}</b></td><td>${length(contact.x_mm)}</td><td>${length(contact.y_mm)}</td>` +
      `<td>${small(contact.depth_mm, contact.depth_std_mm, length)}</td><td>${small(contact.force_N, contact.force_std_N, force)}</td></tr>`;
    const near = nearest(contact, others, 0.1 * reach);
    if (!near) return own;
    return own + `<tr class="beside"><td>${name}</td><td>${length(near.x_mm)}</td><td>${length(near.y_mm)}</td><td>${length(near.depth_mm)}</td><td>${force(near.force_N)}</td></tr>`;
  });
  write(find("contacts").tBodies[0], rows.join(""));
  find("contacts").hidden = contacts.length === 0;
  find("contacts-empty").hidden = contacts.length > 0;
  find("contact-count").textContent = contacts.length;
}

function nearest(contact, others, within) {
  const away = ({ x_mm, y_mm }) => Math.hypot(x_mm - contact.x_mm, y_mm - contact.y_mm);
  return others.reduce((best, other) => (away(other) < (best ? away(best) : within) ? other : best), null);
}

/** What is measured at the chosen points, and the profile between two. */
export function showMeasure(points, measured) {
  const has = points.length > 0;
  find("measure-empty").hidden = has;
  find("measure").hidden = find("measure-clear").hidden = !has;
  find("profile-stage").hidden = points.length < 2;
  if (!has || !measured || measured.points.length !== points.length) return;
  const fine = (value) => length(value, 1);
  const lines = measured.points.map(({ x_mm, y_mm, depth_mm, std_mm }, at) =>
    `<dt>${"AB"[at]} at ${length(x_mm)}, ${length(y_mm)}</dt><dd>depth ${withStd(depth_mm, std_mm, fine)} ${units.length}</dd>`);
  if (measured.profile) {
    lines.push(`<dt>distance now</dt><dd>${withStd(measured.distance_mm, measured.distance_std_mm, fine)} ${units.length}</dd>`,
      `<dt>distance at rest</dt><dd>${fine(measured.rest_distance_mm)} ${units.length}</dd>`,
      `<dt>B deeper than A by</dt><dd>${fine(measured.difference_mm)} ${units.length}</dd>`);
    drawProfile(measured.profile);
  }
  write(find("measure"), lines.join(""));
}

function drawProfile({ length_mm, depth_mm, std_mm }) {
  const count = depth_mm.length, x = new Float32Array(count), y = new Float32Array(count), std = new Float32Array(count);
  for (let i = 0; i < count; i++) {
    x[i] = inLength((length_mm * i) / (count - 1));
    y[i] = depth_mm[i] === null ? NaN : inLength(depth_mm[i]);
    std[i] = std_mm[i] === null ? 0 : inLength(std_mm[i]);
  }
  const known = [...y].filter((value) => value === value), most = Math.max(...known, inLength(0.1)), least = Math.min(...known, 0);
  plot(find("profile"), {
    lines: [{ x, y, count, colour: styled("--accent"), std }],
    xs: [0, Math.max(inLength(length_mm), 1e-6)], ys: [least < -0.02 * most ? -niceCeiling(-least) : 0, niceCeiling(most * 1.1)],
    title: `depth from A to B (${units.length})`, xWords: (value, step) => fixed(value, step < 1 ? 1 : 0), empty: known.length ? "" : "not known here",
  });
}

/** The strip of the header and the card: how well it sees, and how fast. */
export function showHealth(health, head) {
  const seen = health.markers ? health.markers_seen / health.markers : 1;
  const picture = head?.picture;
  const latency = health.message_ms_p50 ?? health.latency_ms_p50, latest = health.message_ms_p99 ?? health.latency_ms_p99;
  write(find("vitals"), [`<span><b>${fixed(health.fps, 0)}</b> fps</span>`, `<span><b>${fixed(latency, 0)}</b> ms latency</span>`,
    `<span><b>${health.dropped}</b> dropped</span>`, `<span><b>${health.markers_seen}</b> of ${health.markers} markers</span>`].join(""));
  const rows = [
    ["method", health.method, ""],
    ["reading a frame", `${fixed(head?.milliseconds, 1)} ms`, ""],
    ["latency p50, p99", `${fixed(latency, 0)}, ${fixed(latest, 0)} ms`, latest > 120 ? "warn" : ""],
    ["frames dropped", `${health.dropped} of ${health.frames + health.dropped}`, health.dropped > 0.02 * (health.frames + 1) ? "warn" : ""],
    ["markers seen", `${health.markers_seen} of ${health.markers}`, seen < 0.8 ? "bad" : seen < 0.95 ? "warn" : ""],
    ["focus", picture ? `${fixed(100 * picture.focus, 0)} % of best` : "–", picture && picture.focus < 0.6 ? "warn" : ""],
    ["exposure", picture ? `${fixed(100 * picture.level, 0)} %, ${fixed(100 * picture.clipped, 1)} % clipped` : "–", picture && picture.clipped > 0.3 ? "warn" : ""],
    ["residual at rest", isKnown(head?.residual_mm) ? `${length(head.residual_mm, 1)} ${units.length}` : "touched", ""],
  ];
  write(find("health"), rows.map(([name, value, kind]) => `<dt>${name}</dt><dd class="${kind}">${value}</dd>`).join(""));
  const notes = find("notes"), last = health.notes.slice(-4);
  const text = JSON.stringify(last);
  if (notes.dataset.html !== text) {
    notes.dataset.html = text;
    notes.replaceChildren(...last.map((note) => Object.assign(document.createElement("li"), { textContent: note })));
  }
}
