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
  find("settings").addEventListener("toggle", () => fillSettings(state));
}

export function fillSettings({ sceneInfo, health }) {
  if (!sceneInfo || !health) return;
  find("method").replaceChildren(...health.methods.map(option));
  find("method").value = health.method;
  find("length-unit").replaceChildren(...lengthUnits(sceneInfo.unit).map(option));
  find("length-unit").value = units.length;
  find("parameters").replaceChildren(...Object.entries(health.parameters).map(([name, value]) => {
    const words = health.choices[name];
    const input = document.createElement(words ? "select" : "input");
    if (words) input.append(...words.map(option));
    else Object.assign(input, { type: "number", step: "any", placeholder: "automatic" });
    Object.assign(input, { name, value: value ?? "" });
    const label = document.createElement("label");
    label.append(name.replace(".", " › ").replaceAll("_", " "), input);
    return label;
  }));
  const settings = health.settings.flatMap(({ name, requested, found }) => {
    const dt = Object.assign(document.createElement("dt"), { textContent: name });
    const dd = Object.assign(document.createElement("dd"), { textContent: `${found ?? "not reported"}${requested && requested !== found ? ` (requested: ${requested})` : ""}` });
    return [dt, dd];
  });
  find("camera-settings").replaceChildren(...(settings.length ? settings : [Object.assign(document.createElement("dd"), { textContent: "this source has no camera settings" })]));
  const assumptions = sceneInfo.assumptions.length ? sceneInfo.assumptions.map((text) => `assumed: ${text}`) : ["no assumptions"];
  find("assumptions").replaceChildren(...assumptions.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
}
