// The settings: method, units, thresholds, camera settings and assumptions.

import { lengthUnits, units } from "./numbers.js";

const find = (id) => document.getElementById(id);
const option = (name) => new Option(name, name);

export function bindSettings(state, send, redraw) {
  find("method").addEventListener("change", ({ target }) => send("method", { method: target.value }));
  find("length-unit").addEventListener("change", ({ target }) => { units.length = target.value; redraw(); });
  find("force-unit").addEventListener("change", ({ target }) => { units.force = target.value; redraw(); });
  find("range").addEventListener("change", ({ target }) => { state.holdRange = target.value === "fixed"; redraw(); });
  find("parameters").addEventListener("change", ({ target }) => {
    const value = target.tagName === "SELECT" ? target.value : target.value === "" ? null : Number(target.value);
    if (!target.validity.badInput) send("tune", { parameter: target.name, value });
  });
  find("parameters").addEventListener("click", ({ target }) => {
    const name = target.dataset.parameter, changed = target.id === "reset-all" ? Object.keys(state.parameters ?? {}) : name ? [name] : [];
    if (target.tagName === "BUTTON") target.blur();
    for (const each of changed) {
      const value = state.parameters[each].default;
      if (state.health.parameters[each] !== value) send("tune", { parameter: each, value });
    }
  });
  find("settings").addEventListener("toggle", () => fillSettings(state));
}

/** One parameter: label, input, unit, reset, and its help below. */
function row(name, health, info) {
  const value = health.parameters[name], words = health.choices[name];
  const input = document.createElement(words ? "select" : "input");
  if (words) input.append(...words.map(option));
  else Object.assign(input, { type: "number", step: "any", placeholder: "automatic" });
  Object.assign(input, { name, value: value ?? "" });
  const label = document.createElement("label"), unit = document.createElement("span"), reset = document.createElement("button");
  unit.className = "unit"; unit.textContent = info?.unit ?? "";
  Object.assign(reset, { className: "small reset", textContent: "reset", title: `Default: ${info?.default ?? "automatic"}` });
  reset.dataset.parameter = name;
  label.append(Object.assign(document.createElement("span"), { textContent: info?.label ?? name.replaceAll(".", " › ").replaceAll("_", " ") }), input, unit, reset);
  const help = Object.assign(document.createElement("p"), { className: "help", textContent: info?.help ?? "" });
  const box = document.createElement("div");
  box.className = "parameter";
  box.append(label, help);
  return box;
}

/** Values and reset buttons as the session has them now; what is being typed stays. */
export function refreshParameters({ health, parameters }) {
  for (const input of find("parameters").querySelectorAll("[name]")) {
    const value = health.parameters[input.name] ?? null, info = parameters?.[input.name];
    if (input !== document.activeElement) input.value = value ?? "";
    input.closest("label").querySelector(".reset").style.visibility = info && value !== info.default ? "" : "hidden";
  }
}

export function fillSettings({ sceneInfo, health, parameters }) {
  if (!sceneInfo || !health) return;
  find("method").replaceChildren(...health.methods.map(option));
  find("method").value = health.method;
  find("length-unit").replaceChildren(...lengthUnits(sceneInfo.unit).map(option));
  find("length-unit").value = units.length;
  const names = Object.keys(health.parameters), known = parameters ?? {};
  const order = [...Object.keys(known).filter((name) => name in health.parameters), ...names.filter((name) => !(name in known))];
  const rows = (isEssential) => order.filter((name) => Boolean(known[name]?.is_essential) === isEssential).map((name) => row(name, health, known[name]));
  find("essential").replaceChildren(...rows(true));
  find("others").replaceChildren(...rows(false));
  refreshParameters({ health, parameters });
  const settings = health.settings.flatMap(({ name, requested, found }) => {
    const dt = Object.assign(document.createElement("dt"), { textContent: name });
    const dd = Object.assign(document.createElement("dd"), { textContent: `${found ?? "not reported"}${requested && requested !== found ? ` (requested: ${requested})` : ""}` });
    return [dt, dd];
  });
  find("camera-settings").replaceChildren(...(settings.length ? settings : noSettings()));
  const assumptions = sceneInfo.assumptions.length ? sceneInfo.assumptions.map((text) => `assumed: ${text}`) : ["no assumptions"];
  find("assumptions").replaceChildren(...assumptions.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
}

function noSettings() {
  const dt = Object.assign(document.createElement("dt"), { textContent: "settings" });
  return [dt, Object.assign(document.createElement("dd"), { textContent: "none for this source" })];
}
