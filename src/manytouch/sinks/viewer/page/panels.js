// Tables of contacts, measurements and health.

import { contactColour, styled } from "./colours.js";
import { render } from "./elements.js";
import { fixed, force, inLength, isKnown, length, niceCeiling, numberAndStd, units, withStd } from "./numbers.js";
import { plot } from "./plot.js";

/** 99th percentile of the latency from which on it is marked: a choice, between three and four frames at 30 per second. */
const SLOW_MS = 120;
const find = (id) => document.getElementById(id);
const cell = (...content) => ["td", {}, ...content];
/** A value with its standard deviation; set apart where 0 lies within two of them. */
function withSmallStd(value, std, write) {
  if (!isKnown(std)) return cell(write(value));
  const [number, deviation] = numberAndStd(value, std, write);
  return ["td", { class: Math.abs(value) < 2 * std ? "weak" : "" }, `${number} `, ["small", {}, deviation]];
}

/** One row per contact, followed by the nearest contact of the comparison. */
export function showContacts(contacts, others, { name, reach, head, pinned }) {
  const heading = (title, unit) => ["th", {}, title, ["br", {}], unit];
  render(find("contacts").tHead, [["tr", {}, ["th", {}], heading("x", units.length), heading("y", units.length), heading("depth", units.length), heading("force", units.force)]]);
  const rows = contacts.flatMap((contact) => {
    const own = ["tr", { class: contact.id === pinned ? "own pinned" : "own", data: contact.id }, cell(["i", { style: { background: contactColour(contact.id) } }], ["b", {}, `#${contact.id}`]), cell(length(contact.x_mm)), cell(length(contact.y_mm)),
      withSmallStd(contact.depth_mm, contact.depth_std_mm, length), withSmallStd(contact.force_N, contact.force_std_N, force)];
    const near = nearest(contact, others, 0.1 * reach);
    const more = detail(contact);
    const rows = more ? [own, ["tr", { class: "comparison", data: contact.id }, ["td", {}], ["td", { class: "detail", span: 4 }, more]]] : [own];
    if (!near) return rows;
    return [...rows, ["tr", { class: "comparison" }, cell(name), cell(length(near.x_mm)), cell(length(near.y_mm)), cell(length(near.depth_mm)), cell(force(near.force_N))]];
  });
  render(find("contacts").tBodies[0], rows);
  find("contacts").hidden = contacts.length === 0;
  find("contacts-empty").hidden = contacts.length > 0;
  find("contact-count").textContent = contacts.length;
  const isValid = !head || head.status === "ok";
  find("contacts-empty").textContent = !head ? "No frame yet." : isValid ? "No contacts." : `Not valid: ${head.status.replaceAll("_", " ")}. ${head.remedy}`;
  find("contacts-empty").classList.toggle("warn", !isValid);
  showTotal(head?.total);
}

/** Shear, torque and slip of a contact, as far as they are known. */
function detail({ shear_N: [x, y], torque_Nmm, slip }) {
  const parts = [];
  if (isKnown(x) && isKnown(y)) parts.push(`shear ${force(Math.hypot(x, y))} ${units.force} at ${fixed((180 * Math.atan2(y, x)) / Math.PI, 0)}°`);
  if (isKnown(torque_Nmm)) parts.push(`torque ${fixed(torque_Nmm, 1)} N·mm`);
  if (slip) parts.push("slips");
  return parts.join(" · ");
}

/** Force and torque on the whole sheet. */
function showTotal(total) {
  const line = find("total");
  line.hidden = !total;
  if (!total) return;
  const { normal_N, normal_std_N, shear_N: [x, y], torque_Nmm } = total, isWeak = Math.abs(normal_N) < 2 * normal_std_N;
  const parts = [`${withStd(normal_N, normal_std_N, force)} ${units.force}`];
  if (isKnown(x) && isKnown(y)) parts.push(`shear ${force(Math.hypot(x, y))} ${units.force}`);
  if (isKnown(torque_Nmm)) parts.push(`${fixed(torque_Nmm, 1)} N·mm`);
  render(line, [["span", { class: "quiet" }, "total "], isWeak ? ["span", { class: "weak" }, parts.join(" · ")] : ["b", {}, parts.join(" · ")]]);
}

function nearest(contact, others, within) {
  const away = ({ x_mm, y_mm }) => Math.hypot(x_mm - contact.x_mm, y_mm - contact.y_mm);
  return others.reduce((best, other) => (away(other) < (best ? away(best) : within) ? other : best), null);
}

/** The measurement at the chosen points, and the profile between two. */
export function showMeasure(points, measured) {
  const has = points.length > 0;
  find("measure-empty").hidden = has;
  find("measure").hidden = find("measure-clear").hidden = !has;
  find("profile-stage").hidden = points.length < 2;
  if (!has || !measured || measured.points.length !== points.length) return;
  const fine = (value) => length(value, units.length === "pitch" ? 0 : 1);
  const lines = measured.points.map(({ x_mm, y_mm, depth_mm, std_mm }, at) =>
    [`${"AB"[at]} at ${length(x_mm)}, ${length(y_mm)}`, `depth ${withStd(depth_mm, std_mm, fine)} ${units.length}`]);
  if (measured.profile) {
    lines.push(["distance now", `${withStd(measured.distance_mm, measured.distance_std_mm, fine)} ${units.length}`],
      ["distance at rest", `${fine(measured.rest_distance_mm)} ${units.length}`],
      ["depth of B minus A", `${fine(measured.difference_mm)} ${units.length}`]);
    drawProfile(measured.profile);
  }
  render(find("measure"), lines.flatMap(([name, value]) => [["dt", {}, name], ["dd", {}, value]]));
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
    title: `depth from A to B (${units.length})`, tickLabel: (value, step) => fixed(value, step < 1 ? 1 : 0), empty: known.length ? "" : "depth not known here",
  });
}

/** The pretension that is estimated because the sensor file states none. */
function pretensionRow(found) {
  if (!found) return [];
  const unit = "over_E_mm" in found ? "mm" : "pitch";
  const { N_per_mm, std_N_per_mm, [`over_E_${unit}`]: overE, [`std_over_E_${unit}`]: stdOverE } = found;
  if (!isKnown(overE)) return [];
  const text = isKnown(N_per_mm) ? `${withStd(N_per_mm, std_N_per_mm, (value) => fixed(value, 3))} N/mm` : `${withStd(overE, stdOverE, (value) => fixed(value, 4))} ${unit} × E`;
  return [["pretension, estimated", text, ""]];
}

/** The short form in the header, and the pane: image quality and speed. */
export function showHealth(health, head) {
  const seen = health.markers && head ? health.markers_seen / health.markers : 1, markers = head ? `${health.markers_seen} of ${health.markers}` : "–";
  const quality = head?.image_quality, isLive = health.frame_count === null;
  const latency = health.message_ms_p50 ?? health.latency_ms_p50, latencyP99 = health.message_ms_p99 ?? health.latency_ms_p99;
  const vitals = [...(health.is_running ? [[fixed(health.fps, 0), " readings/s"]] : []), ...(isLive ? [[fixed(latency, 0), " ms latency"], [health.dropped, " dropped"]] : []), ...(head ? [[health.markers_seen, ` of ${health.markers} markers`]] : [])];
  render(find("vitals"), vitals.map(([value, name]) => ["span", {}, ["b", {}, value], name]));
  const rows = [
    ["method", head?.is_without_sheet && health.method === "mechanics" ? "perimeter: this frame does not show the sheet as it is stated or assumed" : health.method, ""],
    ["time per frame", `${fixed(head?.milliseconds, 1)} ms`, ""],
    ...(isLive ? [["latency, median and p99", `${fixed(latency, 0)}, ${fixed(latencyP99, 0)} ms`, latencyP99 > SLOW_MS ? "warn" : ""],
      ["frames dropped", `${health.dropped} of ${health.frames + health.dropped}`, health.dropped > 0.02 * (health.frames + 1) ? "warn" : ""]] : []),
    ["markers seen", markers, seen < 0.8 ? "bad" : seen < 0.95 ? "warn" : ""],
    ["focus", quality ? `${fixed(100 * quality.focus, 0)} % of best` : "–", quality && quality.focus < 0.6 ? "warn" : ""],
    ["exposure", quality ? `${fixed(100 * quality.level, 0)} %, ${fixed(100 * quality.clipped, 1)} % clipped` : "–", quality && quality.clipped > 0.3 ? "warn" : ""],
    ["depth at rest", isKnown(head?.residual_mm) ? `${length(head.residual_mm, 1)} ${units.length}` : head?.contacts.length ? "in contact" : "–", ""],
    ...pretensionRow(head?.pretension),
  ];
  render(find("health"), rows.flatMap(([name, value, kind]) => [["dt", {}, name], ["dd", { class: kind }, value]]));
  render(find("notes"), health.notes.slice(-4).map((note) => ["li", {}, note]));
}
