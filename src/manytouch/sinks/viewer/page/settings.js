// The settings: method, units, thresholds, and what camera and sensor say of themselves.

import { lengthUnits, units } from "./numbers.js";

const find = (id) => document.getElementById(id);
const option = (name) => new Option(name, name);

export function bindSettings(state, wish, redraw) {
  find("method").addEventListener("change", ({ target }) => wish("method", { method: target.value }));
  find("length-unit").addEventListener("change", ({ target }) => { units.length = target.value; redraw(); });
  find("force-unit").addEventListener("change", ({ target }) => { units.force = target.value; redraw(); });
  find("range").addEventListener("change", ({ target }) => { state.holdRange = target.value === "hold"; redraw(); });
  find("parameters").addEventListener("change", ({ target }) => {
    const value = Number(target.value);
    if (target.value !== "" && Number.isFinite(value)) wish("tune", { parameter: target.name, value });
  });
  find("settings").addEventListener("toggle", () => fillSettings(state));
}

export function fillSettings({ scenery, health }) {
  if (!scenery || !health) return;
  find("method").replaceChildren(...health.methods.map(option));
  find("method").value = health.method;
  find("length-unit").replaceChildren(...lengthUnits(scenery.unit).map(option));
  find("length-unit").value = units.length;
  find("parameters").replaceChildren(...Object.entries(health.parameters).map(([name, value]) => {
    const input = Object.assign(document.createElement("input"), { type: "number", step: "any", name, value });
    const label = document.createElement("label");
    label.append(name.replace(".", " › ").replaceAll("_", " "), input);
    return label;
  }));
  const settings = health.settings.flatMap(({ name, requested, found }) => {
    const dt = Object.assign(document.createElement("dt"), { textContent: name });
    const dd = Object.assign(document.createElement("dd"), { textContent: `${found ?? "not reported"}${requested && requested !== found ? ` (requested: ${requested})` : ""}` });
    return [dt, dd];
  });
  find("camera-settings").replaceChildren(...(settings.length ? settings : [Object.assign(document.createElement("dd"), { textContent: "no camera settings of this source" })]));
  const said = scenery.assumptions.length ? scenery.assumptions.map((text) => `assumed: ${text}`) : ["nothing had to be assumed"];
  find("assumptions").replaceChildren(...said.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
}
