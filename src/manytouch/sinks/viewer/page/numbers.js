// Numbers as text, in the units that the user has chosen.

const LENGTHS = { mm: [1, 2], "µm": [1000, 0], in: [1 / 25.4, 4], pitch: [1, 3] };
const FORCES = { N: [1, 2], mN: [1000, 0], gf: [101.97162, 1] };

export const units = { length: "mm", force: "N" };

export const lengthUnits = (given) => (given === "pitch" ? ["pitch"] : ["mm", "µm", "in"]);
export const inLength = (mm) => mm * LENGTHS[units.length][0];
export const inForce = (N) => N * FORCES[units.force][0];

const known = (value) => value !== null && value !== undefined && Number.isFinite(value);
const sign = (text) => text.replace(/^-(0(?:\.0*)?)$/, "$1").replace("-", "−");

export const fixed = (value, digits) => (known(value) ? sign(value.toFixed(digits)) : "–");
export const length = (mm, more = 0) => (known(mm) ? fixed(inLength(mm), LENGTHS[units.length][1] + more) : "–");
export const force = (N, more = 0) => (known(N) ? fixed(inForce(N), FORCES[units.force][1] + more) : "–");

/** Texts of a number and its standard deviation; up to four decimals more where this would be shown as zero. */
export function numberAndStd(value, std, write) {
  let more = 0;
  while (std > 0 && more < 4 && !/[1-9]/.test(write(std, more))) more += 1;
  return [write(value, more), `± ${write(std, more)}`];
}

export const withStd = (value, std, write) => (known(std) ? numberAndStd(value, std, write).join(" ") : write(value));
export const isKnown = known;

/** A round step that divides a span into about `count` parts. */
export function niceStep(span, count) {
  const rough = span / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= rough * 0.999);
}

/** The next round number above. */
export function niceCeiling(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * [1, 1.5, 2, 3, 4, 5, 6, 8, 10].find((factor) => factor * power >= value * 0.9999);
}
